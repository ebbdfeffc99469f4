"""Tests of turnscan, by rooms.

Linear algebra here is that of small matrices, which several threads only slow down, the more so
where several tests run at a time: each process uses one, and hands that on to those it starts.
"""

from turnscan.threads import single_threaded_algebra

single_threaded_algebra()
