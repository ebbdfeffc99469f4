"""Tests of turnscan, by rooms.

Linear algebra here is that of small matrices, which several threads only slow down, the more so
where several tests run at a time: each process uses one, and hands that on to those it starts.
"""

import os

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
