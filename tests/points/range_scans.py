"""Range scans as the files of a Cyberware scanner hold them."""

from __future__ import annotations

import numpy as np

POINTS = np.array([[0, 0, 0], [1, 0, 0.5], [0, 1, 0.25], [2, 2, 0]], dtype=np.float32)
CELLS = [[0], [1], [], [2], [], [3]]


def cyberware(form="ascii", newline="\r\n") -> bytes:
    head = newline.join(
        ["ply", f"format {form} 1.0", "obj_info num_cols 3", "obj_info num_rows 2"]
        + ["obj_info echo_lgincr 0.000500", "comment made up", "element vertex 4"]
        + [f"property float {c}" for c in "xyz"]
        + ["element range_grid 6", "property list uchar int vertex_indices", "end_header", ""]
    ).encode()
    if form == "ascii":
        rows = [" ".join(f"{x:g}" for x in p) for p in POINTS]
        rows += [" ".join(map(str, [len(c), *c])) for c in CELLS]
        return head + (newline.join(rows) + newline).encode()
    order = "<" if form == "binary_little_endian" else ">"
    body = POINTS.astype(order + "f4").tobytes()
    for c in CELLS:
        body += bytes([len(c)]) + np.array(c, order + "i4").tobytes()
    return head + body
