"""Pixels that see one tone of a print all over: there one ray tells as much as many."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Singles
from turnscan.simulate._scene import Texture

_ROOM = 2.0
"""Pixels of the print beyond the middles of the pixels around that must have the same tone."""
_EVEN = 0.01
"""Part by which the light of nine pixels differs at most: more of it is the edge of a shadow."""
_AROUND = np.ones((3, 3), np.uint8)


def plain(
    texture: Texture,
    points: Floats,
    places: npt.NDArray[np.intp],
    light: Singles,
    size: tuple[int, int],
) -> Bools:
    """(n,) True where a pixel and the eight around it see one tone of a print, evenly lit.

    ``points`` (n, 3), in the body's frame, are what the middles of the pixels ``places`` (n,) see,
    flat indices of a picture of ``size``; ``light`` (n,) comes from them. Over such a pixel light
    changes in proportion to the place, so that its mean is what the middle has, to 1e-5 of it.
    """
    import cv2

    def around(values: Singles) -> tuple[Singles, Singles]:
        """The largest and the least of each nine; 0 where no print is seen."""
        frame = np.zeros(size, np.float32)
        frame.ravel()[places] = values
        most, least = cv2.dilate(frame, _AROUND), cv2.erode(frame, _AROUND)
        return np.ravel(most)[places], np.ravel(least)[places]

    x, y, off = texture.places(points)
    seen = ~off & ~np.isnan(x)
    x, y = np.where(seen, x, 0), np.where(seen, y, 0)
    whole = around(seen.astype(np.float32))[1] > 0
    reach = np.zeros(len(places), np.float32)
    for values in (x, y):
        most, least = around(values)
        reach = np.maximum(reach, np.maximum(most - values, values - least))
    most, least = around(light)
    return np.asarray(
        whole & (most - least <= _EVEN * most) & (texture.room(x, y) >= reach + _ROOM)
    )
