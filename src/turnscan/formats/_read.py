"""What the readers share: limits, complaints that name the place, and joining equal corners."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.errors import FormatError, LimitExceeded
from turnscan.mesh import Mesh

MAX_FACES = 50_000_000
"""Triangles (and entities, and a third of the vertices) that a file may hold."""
_ZERO = 1e-12
"""Part of a mesh's largest coordinate that is nothing but what rounding leaves of a zero."""
MAX_HEADER = 1 << 16
"""Bytes of a PLY header."""
Text = npt.NDArray[np.uint8]


def complain(kind: str, data: bytes, code: int, at: int) -> None:
    """Raise the error that a reading loop's code stands for, if it stands for one."""
    from turnscan.formats import _parse_kernels as k

    if code == k.OK:
        return
    if code == k.TOO_MANY:
        raise LimitExceeded(
            f"{kind}: more than {MAX_FACES} faces", hint="split the file or coarsen the mesh"
        )
    line = data.count(b"\n", 0, at) + 1
    word = data[at : at + 40].split(b"\n")[0].split()
    found = repr(word[0].decode("ascii", "replace")) if word else "nothing"
    message = {
        k.NOT_A_NUMBER: f"{found} is not the number expected here",
        k.CUT_SHORT: "the file ends before the announced data",
        k.BAD_INDEX: f"{found} names a vertex that does not exist",
        k.NO_CODE: f"{found} is not a group code",
        k.NOT_FINITE: f"{found} is not a finite number",
    }[code]
    raise FormatError(f"{kind} line {line}: {message}", hint="export the file again at its source")


def require(kind: str, good: bool, message: str) -> None:
    """Raise FormatError unless ``good``."""
    if not good:
        raise FormatError(f"{kind}: {message}", hint="export the file again at its source")


def within_limit(kind: str, what: str, count: int, limit: int = MAX_FACES) -> None:
    """Raise LimitExceeded where a file announces more than we accept."""
    if count > limit:
        raise LimitExceeded(
            f"{kind}: {count} {what}, the limit is {limit}",
            hint="split the file or coarsen the mesh",
        )


def text_of(data: bytes) -> Text:
    """Return bytes as an array that compiled loops read."""
    return np.frombuffer(data, np.uint8)


def words(*names: str) -> tuple[Text, ...]:
    """Return ASCII words as arrays."""
    return tuple(np.frombuffer(name.encode("ascii"), np.uint8) for name in names)


def checked(kind: str, points: npt.NDArray[np.floating]) -> Floats:
    """Return (n, 3) points as float64, all finite."""
    values: Floats = np.ascontiguousarray(points, np.float64)
    bad = ~np.isfinite(values).all(axis=1)
    if bad.any():
        i = int(np.argmax(bad))
        require(kind, False, f"vertex {i + 1} at {values[i].tolist()} is not finite")
    return values


def indexed(kind: str, points: Floats, faces: npt.NDArray[np.integer]) -> Mesh:
    """Return a mesh of (n, 3) points and (f, 3) indices from 0, checked."""
    bad = ((faces < 0) | (faces >= len(points))).any(axis=1) if len(faces) else np.zeros(0, bool)
    if bad.any():
        i = int(np.argmax(bad))
        numbers = faces[i].tolist()
        require(kind, False, f"face {i + 1} names {numbers}, there are {len(points)} vertices")
    return Mesh(points, faces.reshape(-1, 3).astype(np.int32))


def triangles(kind: str, lists: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return (t, 3) triangles of polygons that stand end to end as n i j k …"""
    from turnscan.formats._parse_kernels import CUT_SHORT, TOO_MANY
    from turnscan.formats._read_kernels import fans

    code, faces = fans(lists, MAX_FACES)
    require(kind, code != CUT_SHORT, "a polygon's list is truncated")
    if code == TOO_MANY:
        within_limit(kind, "numbers in polygons", len(lists), MAX_FACES)
    found: npt.NDArray[np.int64] = faces
    return found


def soup(kind: str, corners: Floats) -> Mesh:
    """Return the mesh of loose triangles, (3f, 3) corners; equal corners become one vertex.

    So do those that differ by what rounding leaves of a zero: of one corner a CAD program may write
    0 in one triangle and 6e-17 in the next. Vertices are in the order in which they first appear.
    """
    from turnscan.formats._read_kernels import merge

    points = checked(kind, corners)
    size = float(max(points.max(), -points.min())) if len(points) else 0.0
    zero = (points < _ZERO * size) & (points > -_ZERO * size)
    first, number = merge(np.where(zero, 0.0, points).view(np.uint64))  # -0.0 has other bits
    return Mesh(points[first] + 0.0, number.reshape(-1, 3))
