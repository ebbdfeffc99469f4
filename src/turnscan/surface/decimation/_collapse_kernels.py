"""Compiled kernels of the edge collapse: the cheapest move first; imported only when used."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.compiled import njit
from turnscan.surface.decimation._heap_kernels import drop, put
from turnscan.surface.decimation._net_kernels import MOST, Net, Ring, cost, ends, look, room
from turnscan.surface.decimation._rule_kernels import (
    faces_near,
    keeps_near,
    keeps_rim,
    keeps_sides,
    keeps_topology,
)


class Queue(NamedTuple):
    """Vertices by what their cheapest move costs (`_heap_kernels`)."""

    heap: Ints
    place: Ints
    key: Floats
    goal: Ints
    """(v,) the neighbour that this move leads to; −1 for those that may not move."""


@njit(cache=True, nogil=True)
def _price(net: Net, line: Queue, v: int, ring: Ring) -> tuple[int, int]:
    """Look about v and write what each of its moves costs, infinite where it may not be made.

    Gives how many corners and neighbours there are.
    """
    line.key[v], line.goal[v] = np.inf, -1
    if net.locked[v]:
        return 0, 0
    count, have = look(net, v, ring)
    for i in range(have):
        u = ring.near[i]
        ring.costs[i] = np.inf
        # A border vertex moves along its border only.
        if net.rim[0, v] < 0 or ring.seen[i] == 1:
            ring.costs[i] = cost(net.q[v], net.points[u]) + net.own[u]
            if ring.costs[i] < line.key[v]:
                line.key[v], line.goal[v] = ring.costs[i], u
    return count, have


@njit(cache=True, nogil=True)
def _wait(line: Queue, size: int, v: int) -> int:
    """Put v where its key belongs, or take it out; gives the new size."""
    if line.goal[v] < 0:
        return drop(line.heap, line.place, line.key, size, v)
    return put(line.heap, line.place, line.key, size, v)


@njit(cache=True, nogil=True)
def _wait_again(net: Net, line: Queue, size: int, v: int, u: int, ring: Ring, spare: Ring) -> int:
    """Put u, that v has become, and its neighbours where they now belong; gives the new size.

    Of a neighbour's moves that to v is gone and that to u costs something else. The others cost
    what they did, so that inside the surface only those whose cheapest was one of the two have to
    be looked at as a whole.
    """
    _, near = look(net, u, ring)
    _price(net, line, u, spare)
    size = _wait(line, size, u)
    for j in range(near):
        w = ring.near[j]
        goal = line.goal[w]
        if goal < 0 or goal in (v, u) or net.rim[0, w] >= 0:
            _price(net, line, w, spare)
        else:
            other = cost(net.q[w], net.points[u]) + net.own[u]
            if other < line.key[w]:
                line.key[w], line.goal[w] = other, u
            elif line.place[w] >= 0:
                continue
        size = _wait(line, size, w)
    return size


@njit(cache=True, nogil=True)
def _move(
    net: Net, v: int, u: int, ring: Ring, count: int, held: Ints, owner: Ints, hang: int
) -> int:
    """v becomes u; gives how many faces vanish."""
    gone = 0
    for i in range(count):
        c = ring.corners[i]
        f = c // 3
        net.first[f] = -1
        a, b = ends(net.faces, c)
        if a == u or b == u:
            net.faces[f, 0] = -1
            gone += 1
        else:
            net.faces[f, c % 3] = u
            net.after[c] = net.head[u]
            net.head[u] = c
    for i in range(hang):
        net.follow[held[i]] = net.first[owner[i]]
        net.first[owner[i]] = held[i]
    net.own[u] += cost(net.q[v], net.points[u])
    for i in range(10):
        net.q[u, i] += net.q[v, i]
    if net.rim[0, v] >= 0:
        a, b = net.rim[1, v], net.rim[0, v]
        net.rim[0, a], net.rim[1, b] = b, a
    net.head[v] = -1
    return gone


@njit(cache=True, nogil=True)
def queue(net: Net) -> tuple[Queue, int]:
    """All vertices that may move, the cheapest first, and how many."""
    mine = room()
    total = len(net.points)
    line = Queue(
        heap=np.empty(total, dtype=np.int32),
        place=np.full(total, -1, dtype=np.int32),
        key=np.empty(total),
        goal=np.empty(total, dtype=np.int32),
    )
    size = 0
    for v in range(total):
        _price(net, line, v, mine)
        size = _wait(line, size, v)
    return line, size


@njit(cache=True, nogil=True)
def collapse(
    net: Net, line: Queue, size: int, left: int, wanted: int, most: int
) -> tuple[int, int]:
    """Move vertices into their neighbours, the cheapest first; the arrays of ``net`` change.

    ``size`` vertices stand in ``line`` and ``left`` faces are there. It ends at ``wanted`` faces,
    when no move is allowed, or after ``most`` vertices. Returns the new size and faces left.
    """
    mine, theirs = room(), room()
    held, owner = np.empty(1 << 14, dtype=np.int32), np.empty(1 << 14, dtype=np.int32)
    n, m = np.empty(3), np.empty(3)
    for _ in range(most):
        if size == 0 or left <= wanted:
            break
        v = line.heap[0]
        size = drop(line.heap, line.place, line.key, size, v)
        count, have = _price(net, line, v, mine)
        for _ in range(have):
            i = np.argmin(mine.costs[:have])
            if mine.costs[i] == np.inf:
                break
            mine.costs[i] = np.inf
            u = mine.near[i]
            others, near = look(net, u, theirs)
            if others < 0 or count + others > MOST:
                continue
            if not (
                keeps_topology(net.faces, mine, count, have, u, mine.seen[i], theirs, others, near)
                and keeps_sides(net, v, u, mine, count, n, m)
                and (net.rim[0, v] < 0 or net.limit == np.inf or keeps_rim(net, v))
            ):
                continue
            hang = 0
            if net.limit < np.inf:
                hang = keeps_near(net, u, mine, count, held, owner)
                if hang < 0 or not faces_near(net, u, mine, count, held, hang, n):
                    continue
            left -= _move(net, v, u, mine, count, held, owner, hang)
            size = _wait_again(net, line, size, v, u, theirs, mine)
            break
    return size, left
