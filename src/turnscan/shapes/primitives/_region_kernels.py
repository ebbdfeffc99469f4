"""Compiled kernels of region growing: neighbours, smooth normals, patches, growth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, Longs
from turnscan.compiled import njit
from turnscan.shapes.primitives._surface_kernels import at, lean

_STRAIGHT = 0.85
"""Cosine of how far a line of neighbours may turn at a vertex."""


class Neighbourhood(NamedTuple):
    """The vertices of a mesh as growing sees them; numba takes it as a tuple of arrays."""

    vertices: Floats
    """(v, 3) mm."""
    normals: Floats
    """(v, 3) smooth, outward."""
    limit: Floats
    """(v,) mm: how far each may lie off its surface."""
    start: Longs
    near: Ints
    """Neighbours of vertex i: near[start[i]:start[i + 1]]."""


class Marks(NamedTuple):
    """What growing has tried; its arrays are written to."""

    label: Longs
    """(v,) the region of each vertex; negative where it is free."""
    seen: Longs
    """(v,) the last ``mark`` under which a vertex was taken, or asked."""
    mark: int
    """Of this search; each search has its own."""


class Surface(NamedTuple):
    """One analytic surface (`_surface_kernels`)."""

    kind: int
    q: Floats
    """(10,) its numbers."""
    side: float
    """+1 where its normal looks outward, −1 inward."""


class Surfaces(NamedTuple):
    """Several of them."""

    kinds: Longs
    """(r,)."""
    q: Floats
    """(r, 10)."""
    side: Floats
    """(r,)."""
    reach: Floats
    """(r,) mm: no vertex further off joins it."""


@njit(cache=True, nogil=True)
def neighbours(faces: Ints, count: int) -> tuple[Longs, Ints]:
    """Vertices next to each vertex as a compressed list: near[start[i]:start[i + 1]]."""
    many = np.zeros(count + 1, dtype=np.int64)
    for f in range(len(faces)):
        for k in range(3):
            many[faces[f, k] + 1] += 2
    for i in range(count):
        many[i + 1] += many[i]
    room = np.empty(many[count], dtype=np.int32)
    end = many[:-1].copy()
    for f in range(len(faces)):
        for k in range(3):
            a = faces[f, k]
            for m in range(1, 3):
                b = faces[f, (k + m) % 3]
                there = False
                for e in range(many[a], end[a]):
                    if room[e] == b:
                        there = True
                        break
                if not there:
                    room[end[a]] = b
                    end[a] += 1
    start = np.zeros(count + 1, dtype=np.int64)
    for i in range(count):
        start[i + 1] = start[i] + end[i] - many[i]
    near = np.empty(start[count], dtype=np.int32)
    for i in range(count):
        near[start[i] : start[i + 1]] = room[many[i] : end[i]]
    return start, near


@njit(cache=True, nogil=True)
def smoothed(normals: Floats, start: Longs, near: Ints, rounds: int) -> Floats:
    """Normals (v, 3) averaged with those of their neighbours, so many times."""
    now = normals.copy()
    for _ in range(rounds):
        then = now.copy()
        for i in range(len(now)):
            x, y, z = then[i, 0], then[i, 1], then[i, 2]
            for e in range(start[i], start[i + 1]):
                k = near[e]
                x += then[k, 0]
                y += then[k, 1]
                z += then[k, 2]
            long = max(np.sqrt(x * x + y * y + z * z), 1e-300)
            now[i, 0], now[i, 1], now[i, 2] = x / long, y / long, z / long
    return now


@njit(cache=True, nogil=True)
def calmed(vertices: Floats, start: Longs, near: Ints, rounds: int) -> Floats:
    """Vertices (v, 3) at the mean of themselves and their neighbours, so many times."""
    now = vertices.copy()
    for _ in range(rounds):
        then = now.copy()
        for i in range(len(now)):
            for e in range(start[i], start[i + 1]):
                for a in range(3):
                    now[i, a] += then[near[e], a]
            for a in range(3):
                now[i, a] /= 1 + start[i + 1] - start[i]
    return now


@njit(cache=True, nogil=True)
def scatter(vertices: Floats, normals: Floats, start: Longs, near: Ints) -> tuple[Floats, Floats]:
    """How each vertex stands off the mean of its neighbours along the normal.

    Returns (v,) mm scaled to one standard deviation of independent noise, and (v,) how far the
    smooth normals of the neighbours turn at most, as 1 − cos.
    """
    off = np.zeros(len(vertices))
    turn = np.full(len(vertices), 2.0)
    for i in range(len(vertices)):
        many = start[i + 1] - start[i]
        if many < 3:
            continue
        s, most = 0.0, 0.0
        for e in range(start[i], start[i + 1]):
            k = near[e]
            c = 0.0
            for a in range(3):
                s += (vertices[k, a] - vertices[i, a]) * normals[i, a]
                c += normals[k, a] * normals[i, a]
            most = max(most, 1.0 - c)
        off[i] = s / many / np.sqrt(1.0 + 1.0 / many)
        turn[i] = most
    return off, turn


@njit(cache=True, nogil=True)
def _onward(vertices: Floats, start: Longs, near: Ints, before: int, here: int) -> int:
    """The neighbour that goes straight on from ``before`` over ``here``; -1 where none does."""
    best, k = _STRAIGHT, -1
    ax, ay, az = vertices[here] - vertices[before]
    long = np.sqrt(ax * ax + ay * ay + az * az)
    for e in range(start[here], start[here + 1]):
        bx, by, bz = vertices[near[e]] - vertices[here]
        size = long * np.sqrt(bx * bx + by * by + bz * bz)
        c = (ax * bx + ay * by + az * bz) / max(size, 1e-300)
        if c > best:
            best, k = c, near[e]
    return k


@njit(cache=True, nogil=True)
def _off_cubic(s: Floats, w: Floats) -> float:
    """Root mean square of what values ``w`` at places ``s`` stand off their cubic, for each degree
    of freedom that is left."""
    basis = np.empty((4, len(s)))
    for j in range(4):
        basis[j] = (2.0 * (s - s[0]) / max(s[-1] - s[0], 1e-300) - 1.0) ** j
        for i in range(j):
            basis[j] -= (basis[j] @ basis[i]) * basis[i]
        basis[j] /= max(np.sqrt(basis[j] @ basis[j]), 1e-300)
    rest = w.copy()
    for j in range(4):
        rest -= (rest @ basis[j]) * basis[j]
    return float(np.sqrt((rest @ rest) / (len(s) - 4)))


@njit(cache=True, nogil=True)
def off_lines(
    seeds: Longs, many: int, vertices: Floats, calm: Floats, normals: Floats, start: Longs,
    near: Ints,
) -> Floats:  # fmt: skip
    """(n,) mm: how far lines of ``many`` vertices stand off smooth ones, root mean square.

    Each goes straight on from neighbour to neighbour, both ways from a seed and the nearest of its
    neighbours: along the stripes of a scan, where these lie further apart than the points on them.
    What is straight is asked of the ``calm`` vertices (v, 3), for noise may be as much as the
    points are apart. NaN where no such line goes on.
    """
    out = np.full(len(seeds), np.nan)
    half = many // 2
    line = np.empty(2 * half, dtype=np.int64)
    s, w = np.empty(2 * half), np.empty(2 * half)
    for i in range(len(seeds)):
        seed, next_, least = seeds[i], -1, np.inf
        for e in range(start[seed], start[seed + 1]):
            gap = calm[near[e]] - calm[seed]
            if gap @ gap < least:
                least, next_ = gap @ gap, near[e]
        line[half - 1], line[half] = seed, next_
        k = 0 if next_ >= 0 else -1
        for j in range(1, half):
            if k >= 0:
                k = _onward(calm, start, near, line[half - 2 + j], line[half - 1 + j])
                line[half + j] = k
            if k >= 0:
                k = _onward(calm, start, near, line[half + 1 - j], line[half - j])
                line[half - 1 - j] = k
        if k < 0:
            continue
        n = np.zeros(3)
        for vertex in line:
            n += normals[vertex]
        n /= max(float(np.sqrt(n @ n)), 1e-300)
        s[0] = 0.0
        for j in range(2 * half):
            gap = calm[line[j]] - calm[line[max(j - 1, 0)]]
            s[j] = s[max(j - 1, 0)] + np.sqrt(gap @ gap)
            w[j] = (vertices[line[j]] - vertices[line[0]]) @ n
        out[i] = _off_cubic(s, w)
    return out


@njit(cache=True, nogil=True)
def patch(seed: int, most: int, ground: Neighbourhood, marks: Marks, cos_turn: float) -> Longs:
    """Up to ``most`` free vertices about a seed, nearest first, whose normals turn gently."""
    normals, start, near, seen = ground.normals, ground.start, ground.near, marks.seen
    queue = np.empty(most, dtype=np.int64)
    queue[0] = seed
    seen[seed] = marks.mark
    filled, at = 1, 0
    while at < filled and filled < most:
        here = queue[at]
        at += 1
        for e in range(start[here], start[here + 1]):
            k = near[e]
            if seen[k] == marks.mark or marks.label[k] >= 0:
                continue
            c = 0.0
            for a in range(3):
                c += normals[k, a] * normals[here, a]
            if c < cos_turn:
                continue
            seen[k] = marks.mark
            queue[filled] = k
            filled += 1
            if filled >= most:
                break
    return queue[:filled].copy()


@njit(cache=True, nogil=True)
def better_about(
    seeds: Longs, below: Floats, value: Floats, ground: Neighbourhood, most: int, cos_turn: float
) -> Floats:
    """(n,) of up to ``most`` vertices about each seed, nearest first, the share whose value is at
    most ``below`` (v,) of the seed; only those whose normal is within the turn of the seed's."""
    normals, start, near = ground.normals, ground.start, ground.near
    seen = np.full(len(value), -1, dtype=np.int64)
    queue = np.empty(most, dtype=np.int64)
    share = np.zeros(len(seeds))
    for s in range(len(seeds)):
        seed = seeds[s]
        queue[0] = seed
        seen[seed] = s
        filled, at, good = 1, 0, 0
        while at < filled and filled < most:
            here = queue[at]
            at += 1
            for e in range(start[here], start[here + 1]):
                k = near[e]
                if seen[k] == s or filled >= most:
                    continue
                c = 0.0
                for a in range(3):
                    c += normals[k, a] * normals[seed, a]
                if c < cos_turn:
                    continue
                seen[k] = s
                queue[filled] = k
                filled += 1
                if value[k] <= below[seed]:
                    good += 1
        share[s] = good / max(filled - 1, 1)
    return share


@njit(cache=True, nogil=True, error_model="numpy")
def grown(
    surface: Surface, ground: Neighbourhood, marks: Marks, seeds: Longs, cos_turn: float, most: int
) -> Longs:
    """Up to ``most`` free vertices connected to the seeds that lie on the surface, nearest first.

    Each is within its limit, its smooth normal within the turn of the surface's. Those that are
    not are marked as seen, too: they would be asked again from each of their neighbours.
    """
    X, N, limit, start, near = ground
    label, seen, mark = marks
    kind, q, side = surface
    cos, sin = lean(kind, q)
    most = min(most, len(X))
    queue = np.empty(most, dtype=np.int64)
    filled, next_, seeded = 0, 0, 0
    while filled < most and (seeded < len(seeds) or next_ < filled):
        # The seeds first, as if one vertex had them all for neighbours.
        here = -1
        first, last = seeded, len(seeds)
        if seeded == len(seeds):
            here = queue[next_]
            next_ += 1
            first, last = start[here], start[here + 1]
        seeded = len(seeds)
        for e in range(first, last):
            k = seeds[e] if here < 0 else near[e]
            if seen[k] == mark or label[k] >= 0 or filled == most:
                continue
            seen[k] = mark
            d, n0, n1, n2, _, _ = at(kind, q, cos, sin, X[k, 0], X[k, 1], X[k, 2])
            turn = n0 * N[k, 0] + n1 * N[k, 1] + n2 * N[k, 2]
            # What has no place, NaN, lies on nothing.
            if abs(d) <= limit[k] and turn * side >= cos_turn:
                queue[filled] = k
                filled += 1
    return queue[:filled].copy()


@njit(cache=True, nogil=True)
def eroded(member: Bools, start: Longs, near: Ints, border: Bools, rounds: int) -> Bools:
    """Members (v,) that are so many steps away from what is no member and from no border."""
    now = member.copy()
    for _ in range(rounds):
        then = now.copy()
        for i in range(len(now)):
            if not then[i]:
                continue
            if border[i]:
                continue
            for e in range(start[i], start[i + 1]):
                if not then[near[e]]:
                    now[i] = False
                    break
    return now


@njit(cache=True, nogil=True)
def levelled(
    member: Longs, value: Floats, start: Longs, near: Ints, rounds: int, place: Longs
) -> Floats:
    """Values (n,) of members averaged with those of the members next to them, so many times.

    ``place`` (v,) is room for it: −1, and again afterwards.
    """
    for i in range(len(member)):
        place[member[i]] = i
    now = value.copy()
    for _ in range(rounds):
        then = now.copy()
        for i in range(len(member)):
            total, many = then[i], 1
            for e in range(start[member[i]], start[member[i] + 1]):
                k = place[near[e]]
                if k >= 0:
                    total += then[k]
                    many += 1
            now[i] = total / many
    for i in range(len(member)):
        place[member[i]] = -1
    return now


@njit(cache=True, nogil=True)
def largest_piece(member: Longs, start: Longs, near: Ints, place: Longs) -> Longs:
    """The largest connected piece of members; ``place`` (v,) as for `levelled`."""
    for i in range(len(member)):
        place[member[i]] = i
    done = np.zeros(len(member), dtype=np.bool_)
    queue, best = np.empty(len(member), dtype=np.int64), member[:0].copy()
    for first in range(len(member)):
        if done[first]:
            continue
        queue[0], filled, at = first, 1, 0
        done[first] = True
        while at < filled:
            here = member[queue[at]]
            at += 1
            for e in range(start[here], start[here + 1]):
                k = place[near[e]]
                if k >= 0 and not done[k]:
                    done[k] = True
                    queue[filled] = k
                    filled += 1
        if filled > len(best):
            best = member[queue[:filled]]
    for i in range(len(member)):
        place[member[i]] = -1
    return best


@njit(cache=True, nogil=True)
def settled(
    label: Longs, off: Floats, surfaces: Surfaces, ground: Neighbourhood, rounds: int
) -> Longs:
    """Labels after each vertex next to another region took the surface it is nearer to.

    ``off`` (v,) is how far each stands off its own surface over its limit, 1 for none; free
    vertices join a neighbour's surface within their limit whatever their normal says, unless it
    looks away: smooth normals are wrong beside an edge.
    """
    kinds, q, side, reach = surfaces
    vertices, normals, limit = ground.vertices, ground.normals, ground.limit
    now = label.copy()
    for _ in range(rounds):
        then = now.copy()
        changed = 0
        for i in range(len(now)):
            for e in range(ground.start[i], ground.start[i + 1]):
                k = then[ground.near[e]]
                if k < 0 or k == now[i]:
                    continue
                own = q[k]
                cos, sin = lean(kinds[k], own)
                x, y, height = vertices[i, 0], vertices[i, 1], vertices[i, 2]
                d, n0, n1, n2, _, _ = at(kinds[k], own, cos, sin, x, y, height)
                d = abs(d)
                z = d / limit[i]
                c = n0 * normals[i, 0] + n1 * normals[i, 1] + n2 * normals[i, 2]
                if z < off[i] and d <= reach[k] and c * side[k] > 0.0:
                    off[i] = z
                    now[i] = k
                    changed += 1
        if changed == 0:
            break
    return now


@njit(cache=True, nogil=True)
def spread(
    value: Longs, allowed: Bools, start: Longs, near: Ints, rounds: int
) -> tuple[Longs, Longs]:
    """Values (v,) ≥ 0 handed on to allowed neighbours below 0, so many rings far.

    Returns the values, and how many rings each has come (−1: none came).
    """
    out = value.copy()
    ring = np.full(len(value), -1, dtype=np.int64)
    queue = np.empty(len(value), dtype=np.int64)
    filled, at = 0, 0
    for i in range(len(value)):
        if value[i] >= 0:
            ring[i] = 0
            queue[filled] = i
            filled += 1
    while at < filled:
        here = queue[at]
        at += 1
        if ring[here] >= rounds:
            continue
        for e in range(start[here], start[here + 1]):
            k = near[e]
            if ring[k] < 0 and allowed[k]:
                ring[k] = ring[here] + 1
                out[k] = out[here]
                queue[filled] = k
                filled += 1
    return out, ring
