"""Compiled kernels of the edge collapse: the cheapest move first; imported only when used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.compiled import njit
from turnscan.surface.decimation._bucket_kernels import LEAST, SIZE, bucket, empty, put, take
from turnscan.surface.decimation._net_kernels import (
    AFTER,
    AHEAD,
    BACK,
    CORNER,
    HEAD,
    LEFT,
    LOCKED,
    MOST,
    NEAR,
    OWN,
    PLACE,
    RIGHT,
    SAMPLE,
    SEEN,
    WAITS,
    Net,
    cost,
    look,
    room,
)
from turnscan.surface.decimation._rule_kernels import (
    faces_near,
    keeps_near,
    keeps_rim,
    keeps_sides,
    keeps_topology,
)


@njit(cache=True, nogil=True, forceinline=True)
def _price(
    at: Floats, ids: Ints, tri: Ints, v: int, ring: Ints, costs: Floats
) -> tuple[int, int, float]:
    """Look about v and write what each of its moves costs, infinite where it may not be made.

    Gives how many corners and neighbours there are, and what the cheapest move costs.
    """
    if ids[v, LOCKED] == 1:
        return 0, 0, np.inf
    count, have = look(ids, tri, v, ring)
    least = np.inf
    inside = ids[v, AHEAD] < 0
    for i in range(have):
        # A border vertex moves along its border only.
        if inside or ring[SEEN, i] == 1:
            u = ring[NEAR, i]
            costs[i] = cost(at, v, u) + at[u, OWN]
            least = min(least, costs[i])
        else:
            costs[i] = np.inf
    return count, have, least


@njit(cache=True, nogil=True, forceinline=True)
def _move(at: Floats, ids: Ints, tri: Ints, v: int, u: int, ring: Ints, count: int) -> int:
    """v becomes u; gives how many faces vanish."""
    gone = 0
    for i in range(count):
        c = ring[CORNER, i]
        f = c >> 2
        if ring[LEFT, i] == u or ring[RIGHT, i] == u:
            tri[f, 0] = -1
            gone += 1
        else:
            tri[f, c & 3], tri[f, AFTER + (c & 3)] = u, ids[u, HEAD]
            ids[u, HEAD] = c
    at[u, OWN] += cost(at, v, u)
    for i in range(10):
        at[u, i] += at[v, i]
    a, b = ids[v, BACK], ids[v, AHEAD]
    if b >= 0:
        ids[a, AHEAD], ids[b, BACK] = b, a
    ids[v, HEAD] = -1
    return gone


@njit(cache=True, nogil=True)
def _stays_near(
    net: Net, v: int, u: int, ring: Ints, count: int, held: Ints, owner: Ints, n: Floats
) -> bool:
    """Whether the surface stays within the limit when v becomes u; its samples are hung again."""
    if net.ids[v, AHEAD] >= 0 and not keeps_rim(net, v):
        return False
    have = keeps_near(net, u, ring, count, held, owner)
    if have < 0 or not faces_near(net, u, ring, count, held, have, n):
        return False
    for i in range(count):
        net.tri[ring[CORNER, i] >> 2, SAMPLE] = -1
    for i in range(have):
        net.follow[held[i]] = net.tri[owner[i], SAMPLE]
        net.tri[owner[i], SAMPLE] = held[i]
    return True


@njit(cache=True, nogil=True)
def queue(net: Net) -> tuple[Ints, Ints]:
    """All vertices that may move, each where its cheapest move belongs, and how many."""
    at, ids, tri = net.at, net.ids, net.tri
    ring, costs = room(), np.empty(2 * MOST)
    reach = 0.0
    for v in range(len(at)):
        for i in range(PLACE, PLACE + 3):
            reach = max(reach, abs(at[v, i]))
    ends, state = empty(len(at), reach)
    for v in range(len(at)):
        _, _, least = _price(at, ids, tri, v, ring, costs)
        if least < np.inf:
            put(ends, state, ids, v, bucket(state, v, least))
    return ends, state


@njit(cache=True, nogil=True)
def collapse(net: Net, ends: Ints, state: Ints, left: int, wanted: int, most: int) -> int:
    """Move vertices into their neighbours, the cheapest first; the arrays of ``net`` change.

    ``ends`` and ``state`` are the queue, ``left`` faces are there. It ends at ``wanted`` faces,
    when no move is allowed, or after ``most`` vertices. Returns how many faces are left.
    """
    at, ids, tri, limited = net.at, net.ids, net.tri, net.limit < np.inf
    mine, theirs, costs = room(), room(), np.empty(2 * MOST)
    held, owner = np.empty(1 << 14, dtype=np.int32), np.empty(1 << 14, dtype=np.int32)
    n = np.empty(3)
    for _ in range(most):
        if state[SIZE] == 0 or left <= wanted:
            break
        v = take(ends, state, ids)
        count, have, least = _price(at, ids, tri, v, mine, costs)
        refused = False
        while least < np.inf:
            turn = bucket(state, v, least)
            # Distances are not measured twice: who is refused for them tries the others at once.
            if turn > state[LEAST] and not (limited and refused):
                put(ends, state, ids, v, turn)
                break
            i = 0
            while costs[i] != least:
                i += 1
            u, shared = mine[NEAR, i], mine[SEEN, i]
            others, near = look(ids, tri, u, theirs)
            if (
                others >= 0
                and count + others <= MOST
                and keeps_topology(mine, count, have, u, shared, theirs, others, near)
                and keeps_sides(at, v, u, mine, count)
                and (not limited or _stays_near(net, v, u, mine, count, held, owner, n))
            ):
                left -= _move(at, ids, tri, v, u, mine, count)
                # Who waits is asked again when it is its turn. Who was out waits again.
                _, near = look(ids, tri, u, theirs)
                for j in range(-1, near):
                    w = u if j < 0 else theirs[NEAR, j]
                    if ids[w, WAITS] == 0:
                        _, _, least = _price(at, ids, tri, w, mine, costs)
                        if least < np.inf:
                            put(ends, state, ids, w, bucket(state, w, least))
                break
            costs[i], refused = np.inf, True
            least = costs[0]
            for j in range(1, have):
                least = min(least, costs[j])
    return left
