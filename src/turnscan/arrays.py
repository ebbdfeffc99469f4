"""The array types of turnscan, and the check that every frozen dataclass gives its arrays."""

from __future__ import annotations

from typing import Any, TypeVar, overload
from weakref import WeakValueDictionary

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

ColourWeights = tuple[float, float, float]
"""How much of red, green and blue makes the grey picture in which the laser stands out."""

Region = tuple[int, int, int, int]
"""Part of a picture: first column and row, and those after the last."""

Scalar = TypeVar("Scalar", bound=np.generic)

_SMALL = 256
"""Items of an array up to which a check costs less than to remember it."""
_checked: dict[bool, WeakValueDictionary[int, npt.NDArray[Any]]] = {
    nan: WeakValueDictionary() for nan in (False, True)
}
"""Arrays that `frozen` made, by their identity, apart whether they may hold NaN."""


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
    infinity is never allowed. An array that was made here is handed on as it is, neither copied nor
    checked again: it is read-only, so that what was right once stays right.

    Raises ValueError, naming the field and the value, where shape or content do not fit.
    """
    known = is_frozen(values, dtype, nan=nan)
    array: npt.NDArray[Any] = np.ascontiguousarray(values, dtype=dtype)
    if array.shape != shape and (
        array.ndim != len(shape)
        or any(want not in (None, have) for have, want in zip(array.shape, shape, strict=True))
    ):
        wanted = tuple("any" if s is None else s for s in shape)
        raise ValueError(f"{name}: shape {array.shape}, expected {wanted}")
    if known:
        return array
    _check_finite(array, name, nan=nan)
    if array is values or array.base is not None:
        array = array.copy()
    return _remembered(array, nan=nan)


def handed_over(values: npt.NDArray[Scalar], *, nan: bool = False) -> npt.NDArray[Scalar]:
    """``values`` made read-only by its maker, who lets go of it: `frozen` takes it without a copy.

    No view of it may be left, for that could still write to it. A part of another array is copied.
    Raises ValueError, naming the value, where it holds infinity, or NaN without ``nan``.
    """
    _check_finite(values, "array", nan=nan)
    if values.base is not None or not values.flags.c_contiguous:
        values = np.array(values, order="C")
    return _remembered(values, nan=nan)


def cross(first: Floats, second: Floats) -> Floats:
    """The cross product (..., 3) of arrays (..., 3), to the bit as NumPy's, which moves axes about
    for longer than it multiplies."""
    out = np.empty(np.broadcast_shapes(first.shape, second.shape))
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        part = out[..., k]
        np.multiply(first[..., i], second[..., j], out=part)
        part -= first[..., j] * second[..., i]
    return out


def _check_finite(array: npt.NDArray[Any], name: str, *, nan: bool) -> None:
    if array.dtype.kind != "f":
        return
    bad = np.isinf(array) if nan else ~np.isfinite(array)
    if np.count_nonzero(bad):
        place = tuple(int(i) for i in np.argwhere(bad)[0])
        raise ValueError(f"{name}{list(place)}: {array[place]} is not a finite number")


def _remembered(array: npt.NDArray[Scalar], *, nan: bool) -> npt.NDArray[Scalar]:
    array.flags.writeable = False
    if array.size > _SMALL:
        _checked[nan][id(array)] = array
    return array


def is_frozen(values: npt.ArrayLike, dtype: type[Any] | None = None, *, nan: bool = False) -> bool:
    """Whether an array, not a small one, was made by `frozen`: it is as it was, and stays so.

    It is of that ``dtype`` and may hold ``nan``, where they are told.
    """
    if not isinstance(values, np.ndarray) or values.flags.writeable:
        return False
    if dtype is not None and values.dtype != dtype:
        return False
    kinds = (False, True) if nan else (False,)
    return any(_checked[kind].get(id(values)) is values for kind in kinds)
