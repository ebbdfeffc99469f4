"""Exposure bracketing: several exposures of one scene into one picture of greater range."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Image, frozen
from turnscan.errors import InputError


@dataclass(frozen=True)
class Fused:
    """A picture in the scale of its shortest exposure, spread over 16 bits."""

    image: npt.NDArray[np.uint16]
    """(H, W) or (H, W, 3); 65535 is where the shortest exposure clips."""
    sigma: npt.NDArray[np.float32]
    """Same shape: predicted standard deviation of ``image`` in its levels, NaN where clipped."""
    saturated: Bools
    """Same shape: clipped even in the shortest exposure."""
    scale: float
    """Levels of ``image`` in one level of the shortest exposure."""

    def __post_init__(self) -> None:
        shape = tuple(self.image.shape)
        object.__setattr__(self, "image", frozen(self.image, shape, "image", np.uint16))
        sigma = frozen(self.sigma, shape, "sigma", np.float32, nan=True)
        object.__setattr__(self, "sigma", sigma)
        object.__setattr__(self, "saturated", frozen(self.saturated, shape, "saturated", np.bool_))


def fuse_exposures(
    pictures: Sequence[Image],
    seconds: Sequence[float],
    *,
    read_noise: float,
    electrons_per_dn: float,
    black: float = 0.0,
    saturation: float | None = None,
) -> Fused:
    """Fuse pictures of one scene, taken with different exposure times by a linear camera.

    ``read_noise`` is in grey levels, ``electrons_per_dn`` the electrons of one, ``black`` the level
    without light, ``saturation`` the level from which a pixel counts as clipped (by default the
    top of the scale). The light of each pixel is the mean over its exposures weighted by
    time² / variance, the variance from the noise model at the light found, not at each noisy level
    (which would favour dark outliers). An exposure counts where its own level is below clipping;
    where it is about to clip, that shifts the mean by a fraction of sigma, less than a choice by
    the shorter and noisier exposures would.

    Raises InputError for fewer than two pictures, unequal shapes or types, times that are not
    above 0 or not all different, and noise that cannot be.
    """
    order = _checked(pictures, seconds, read_noise, electrons_per_dn)
    top = float(np.iinfo(pictures[0].dtype).max)
    clip = top if saturation is None else saturation
    if not 0.0 <= black < clip <= top:
        raise InputError(f"black {black:g} and saturation {clip:g}, expected 0 ≤ … < … ≤ {top:g}")
    from turnscan.stripes._fuse_kernels import fuse

    stack = np.stack([pictures[k].ravel() for k in order])
    times = np.array([seconds[k] for k in order], np.float64)
    level = np.empty(stack.shape[1], np.float32)
    sigma = np.empty(stack.shape[1], np.float32)
    rounding = 1.0 / 12.0
    fuse(stack, times, black, clip, read_noise**2 + rounding, 1.0 / electrons_per_dn, level, sigma)
    scale = 65535.0 / clip
    shape = pictures[0].shape
    clipped = np.isnan(sigma)
    image = np.clip(np.round(level * scale), 0, 65535).astype(np.uint16)
    # The 16 bits round once more.
    sigma = np.sqrt((sigma * scale) ** 2 + rounding, dtype=np.float32)
    return Fused(image.reshape(shape), sigma.reshape(shape), clipped.reshape(shape), scale)


def _checked(
    pictures: Sequence[Image], seconds: Sequence[float], noise: float, electrons: float
) -> list[int]:
    """The order from the shortest exposure to the longest."""
    if len(pictures) < 2 or len(pictures) != len(seconds):
        raise InputError(f"{len(pictures)} pictures and {len(seconds)} exposure times to fuse")
    first = pictures[0]
    for picture in pictures:
        if picture.shape != first.shape or picture.dtype != first.dtype:
            raise InputError(
                f"pictures to fuse: {picture.shape} {picture.dtype} among {first.shape} "
                f"{first.dtype}"
            )
    if not all(0.0 < t < math.inf for t in seconds) or len(set(seconds)) != len(seconds):
        raise InputError(f"exposure times {tuple(seconds)}: not all different and above 0 s")
    if not (0.0 <= noise < math.inf and 0.0 < electrons < math.inf):
        raise InputError(f"read noise {noise:g}, {electrons:g} electrons per grey level")
    return sorted(range(len(seconds)), key=lambda k: seconds[k])
