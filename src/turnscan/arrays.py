"""The array types of turnscan, and the check that every frozen dataclass gives its arrays."""

from __future__ import annotations

from typing import Any, TypeVar, overload

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Singles = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]
Longs = npt.NDArray[np.int64]
Bytes = npt.NDArray[np.uint8]
Flags = npt.NDArray[np.uint16]
Bools = npt.NDArray[np.bool_]
Image = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]
"""One picture, shape (H, W) or, in colour, (H, W, 3) in the order red, green, blue."""

Region = tuple[int, int, int, int]
"""Part of a picture: first column and row, and those after the last."""

Scalar = TypeVar("Scalar", bound=np.generic)


@overload
def frozen(
    values: npt.ArrayLike, shape: tuple[int | None, ...], name: str, *, nan: bool = False
) -> Floats: ...


@overload
def frozen(
    values: npt.ArrayLike,
    shape: tuple[int | None, ...],
    name: str,
    dtype: type[Scalar],
    *,
    nan: bool = False,
) -> npt.NDArray[Scalar]: ...


def frozen(
    values: npt.ArrayLike,
    shape: tuple[int | None, ...],
    name: str,
    dtype: type[Any] = np.float64,
    *,
    nan: bool = False,
) -> npt.NDArray[Any]:
    """Return ``values`` as a read-only, C-contiguous array of the wanted shape and type.

    ``shape`` has None where any length will do. ``nan=True`` allows NaN, the mark of missing data;
    infinity is never allowed.

    Raises ValueError, naming the field and the value, where shape or content do not fit.
    """
    array: npt.NDArray[Any] = np.ascontiguousarray(values, dtype=dtype)
    if array.shape != shape and (
        array.ndim != len(shape)
        or any(want not in (None, have) for have, want in zip(array.shape, shape, strict=True))
    ):
        wanted = tuple("any" if s is None else s for s in shape)
        raise ValueError(f"{name}: shape {array.shape}, expected {wanted}")
    if array.dtype.kind == "f":
        bad = np.isinf(array) if nan else ~np.isfinite(array)
        if np.count_nonzero(bad):
            place = tuple(int(i) for i in np.argwhere(bad)[0])
            raise ValueError(f"{name}{list(place)}: {array[place]} is not a finite number")
    if array is values or array.base is not None:
        array = array.copy()
    array.flags.writeable = False
    return array
