"""Compiled kernels of a heap of numbered things by key, the least first; used by other kernels.

``heap`` holds the numbers, ``place`` where each stands in it (−1: not in it), ``key`` what counts.
Of equal keys the lower number comes first, so that the order is always the same.
"""

from __future__ import annotations

from turnscan.arrays import Floats, Ints
from turnscan.compiled import njit


@njit(cache=True, nogil=True)
def _less(key: Floats, a: int, b: int) -> bool:
    return key[a] < key[b] or (key[a] == key[b] and a < b)


@njit(cache=True, nogil=True)
def _rise(heap: Ints, place: Ints, key: Floats, at: int) -> int:
    x = heap[at]
    while at > 0 and _less(key, x, heap[(at - 1) // 2]):
        heap[at] = heap[(at - 1) // 2]
        place[heap[at]] = at
        at = (at - 1) // 2
    heap[at] = x
    place[x] = at
    return at


@njit(cache=True, nogil=True)
def _sink(heap: Ints, place: Ints, key: Floats, size: int, at: int) -> None:
    x = heap[at]
    while 2 * at + 1 < size:
        child = 2 * at + 1
        if child + 1 < size and _less(key, heap[child + 1], heap[child]):
            child += 1
        if not _less(key, heap[child], x):
            break
        heap[at] = heap[child]
        place[heap[at]] = at
        at = child
    heap[at] = x
    place[x] = at


@njit(cache=True, nogil=True)
def put(heap: Ints, place: Ints, key: Floats, size: int, x: int) -> int:
    """Add ``x`` by its key, or move it to where its key now belongs; the heap's new size."""
    at = place[x]
    if at < 0:
        at = size
        heap[at] = x
        size += 1
    _sink(heap, place, key, size, _rise(heap, place, key, at))
    return size


@njit(cache=True, nogil=True)
def drop(heap: Ints, place: Ints, key: Floats, size: int, x: int) -> int:
    """Take ``x`` out, where it is in; the heap's new size."""
    at = place[x]
    if at < 0:
        return size
    place[x] = -1
    size -= 1
    if at < size:
        heap[at] = heap[size]
        _sink(heap, place, key, size, _rise(heap, place, key, at))
    return size
