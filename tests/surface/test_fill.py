"""Filling: what is added, where it lies, what never moves."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.mesh.open_meshes import ball, opened, plate, same_measured
from tests.surface.grids import random_grid
from turnscan.errors import InputError
from turnscan.mesh import Mesh, Provenance, cut_touching, is_closed, join, soundness
from turnscan.meshing import to_mesh
from turnscan.settings import Settings
from turnscan.surface import mesh_grid
from turnscan.surface.holes import (
    ClosingOptions,
    _fill,
    _patch_kernels,
    close,
    closings,
    fill,
    holes,
)

WAYS = ("flat", "tangent", "curvature")


@pytest.mark.parametrize("how", WAYS)
def test_a_hole_in_a_plate_is_filled_in_its_plane(how):
    mesh = plate(12, {(i, j) for i in range(4, 8) for j in range(3, 9)})
    done = fill(mesh, [1], how)
    assert same_measured(mesh, done)
    assert len(holes(done)) == 1
    assert soundness(done) == []
    assert done.area_of() == pytest.approx(144.0)
    assert np.abs(done.vertices[:, 2]).max() < 1e-9
    if how == "flat":
        assert len(done.vertices) == len(mesh.vertices)
    else:
        sides = done.triangles[~done.measured] - np.roll(done.triangles[~done.measured], 1, 1)
        assert 0.7 < np.median(np.linalg.norm(sides, axis=2)) < 1.5, "as dense as round it"


def test_a_ball_is_continued_by_its_curvature():
    mesh = opened(ball(40), [0.3, 0.2, 1.0], 0.5)
    off = {}
    for how in WAYS:
        done = fill(mesh, None, how)
        assert is_closed(done)
        assert soundness(done) == []
        new = done.triangles[~done.measured].mean(axis=1)
        off[how] = float(np.abs(np.linalg.norm(new, axis=1) - 10.0).max())
    # A flat cap lies 1.22 mm too low; the plate that meets the border's tangents far less; with
    # the curvature given, too, only the facets of the ball remain (10 (1 − cos(π/80)) = 0.008).
    assert off["flat"] == pytest.approx(10 * (1 - np.cos(0.5)), abs=0.25)
    assert off["tangent"] < 0.3
    assert off["curvature"] < 0.06


def truncated(slope: float, rings: int = 10, round_: int = 48) -> Mesh:
    """The wall of a cone that stands at ``slope`` rad, cut off 10 mm from its axis."""
    phi = np.arange(round_) * 2 * np.pi / round_
    r = 10.0 + np.arange(rings)
    ring = np.stack(
        [np.outer(r, np.cos(phi)), np.outer(r, np.sin(phi)),
         np.outer((10.0 - r) * np.tan(slope), np.ones(round_))],
        axis=-1,
    )  # fmt: skip
    k = np.arange(round_)
    a, b = k, (k + 1) % round_
    faces = [
        np.concatenate(
            [np.stack([a + m, a + m + round_, b + m + round_], -1),
             np.stack([a + m, b + m + round_, b + m], -1)]
        )
        for m in round_ * np.arange(rings - 1)
    ]  # fmt: skip
    return Mesh(ring.reshape(-1, 3), np.concatenate(faces), None)


@pytest.mark.parametrize(
    ("degrees", "flat"), [(52.0, False), (58.0, False), (62.0, True), (70.0, True)]
)
def test_a_border_that_stands_steeper_than_60_degrees_is_an_edge(
    degrees: float, flat: bool
) -> None:
    """A plate goes on in the cone's own slope and rises a/2 tan β; at an edge nothing rises."""
    cone = truncated(np.radians(degrees))
    top = min(holes(cone), key=lambda h: h.size)
    filled = fill(cone, [top], "auto")
    added = filled.vertices[len(cone.vertices) :]
    rise = float(added[:, 2].max())
    plate = 5.0 * np.tan(np.radians(degrees))
    if flat:
        assert abs(rise) < 0.02 * plate
    else:
        assert 0.3 * plate < rise < 1.2 * plate


def test_noise_at_the_border_does_not_swing_the_filling():
    """A kink of its noise from corner to corner would be carried on as curvature: 4 mm off here."""
    mesh = opened(ball(40, 0.02, 1), [0.3, 0.2, 1.0], 0.5)
    for how, limit in (("tangent", 0.25), ("curvature", 0.1)):
        done = fill(mesh, None, how)
        new = done.triangles[~done.measured].mean(axis=1)
        assert np.abs(np.linalg.norm(new, axis=1) - 10.0).max() < limit
        assert same_measured(mesh, done)


def test_new_vertices_say_that_nobody_measured_them():
    mesh = plate(10, {(i, j) for i in range(2, 7) for j in range(3, 8)})
    v = len(mesh.vertices)
    one = np.zeros(v, np.int32)
    mesh = replace(
        mesh,
        provenance=Provenance(np.full(v, 0.01), one, one, one, ("L0",)),
        colour=np.full((v, 3), (10, 20, 30), np.uint8),
    )
    done = fill(mesh, [holes(mesh)[1]], "tangent")
    p = done.provenance
    assert len(done.vertices) > v
    assert (p.laser[v:] == -1).all()
    assert (p.step[v:] == -1).all()
    assert np.isnan(p.sigma[v:]).all()
    assert (p.laser[:v] == 0).all()
    assert (done.colour[v:] == (10, 20, 30)).all()


def test_a_chord_that_is_taken_is_not_used_again():
    """The four sides of a box without two opposite ones, its corners joined across them."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    bow = Mesh(
        [*vertices, [0.5, 0.5, 3.0], [0.5, 0.5, -3.0]],
        [[0, 2, 4], [2, 0, 5]] + [[0, 1, 5], [1, 2, 5], [2, 3, 4], [3, 0, 4]],
    )
    done = fill(bow, None, "flat")
    assert not [f for f in soundness(done) if f.code in ("surface.side", "surface.orientation")]


def test_holes_of_another_mesh_are_refused():
    mesh = plate(6, {(2, 2)})
    with pytest.raises(InputError, match="not a boundary of this mesh"):
        fill(plate(7), holes(mesh)[1:], "flat")
    with pytest.raises(InputError, match="hole 5: the mesh has 2"):
        fill(mesh, [5], "flat")


def test_a_long_border_is_spanned_too():
    angle = np.linspace(0, 2 * np.pi, 500, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle), 0.1 * np.sin(2 * angle)], axis=1)
    around = np.arange(500)
    band = np.stack([around, np.roll(around, -1), around + 500], axis=1)
    other = np.stack([np.roll(around, -1), np.roll(around, -1) + 500, around + 500], axis=1)
    tube = Mesh(
        np.concatenate([30 * ring, 30 * ring + [0, 0, -1.0]]), np.concatenate([band, other])
    )
    upper = next(i for i, h in enumerate(holes(tube)) if h.centre[2] > -0.5)
    done = fill(tube, [upper], "tangent")
    assert len(holes(done)) == 1
    assert soundness(done) == []


@settings(max_examples=25)
@given(
    seed=st.integers(0, 2**32 - 1),
    steps=st.integers(3, 12),
    lines=st.integers(3, 12),
    missing=st.floats(0, 0.9),
    closed=st.booleans(),
    how=st.sampled_from(WAYS),
)
def test_filling_any_grid_moves_nothing_and_leaves_it_manifold(
    seed, steps, lines, missing, closed, how
):
    mesh, _ = cut_touching(mesh_grid(random_grid(seed, steps, lines, missing, closed, 0.0)))
    done = fill(mesh, None, how)
    assert same_measured(mesh, done)
    if len(mesh.faces):
        assert is_closed(done)
        found = {f.code for f in soundness(done)}
        assert not found & {"surface.side", "surface.orientation", "surface.touching"}
    again = fill(mesh, None, how)
    assert done.vertices.tobytes() == again.vertices.tobytes()
    assert done.faces.tobytes() == again.faces.tobytes()


def test_what_cuts_through_itself_is_repaired():
    mesh = ball(30)
    spike = mesh.vertices.copy()
    spike[400] *= -1.1  # through the ball and out at its other side
    bent = Mesh(spike, mesh.faces)
    assert "surface.crossing" in [f.code for f in soundness(bent)]
    done, said = close(bent, ClosingOptions(floor=None, top=None))
    assert is_closed(done)
    assert soundness(done) == []
    assert said[0].code == "surface.repaired"
    assert np.linalg.norm(done.vertices, axis=1).max() < 10.1
    assert done.volume == pytest.approx(mesh.volume, rel=0.005)
    assert done.area_of(~done.measured) < 0.05 * mesh.area_of()


@pytest.mark.parametrize("how", WAYS)
def test_a_hole_that_something_stands_in_stays_open(how):
    """A ball with a mouth and a small hole below; a hundred needles stand in the mouth."""
    mouth = opened(opened(ball(24), (0, 0, 1), 0.8), (0, 0, -1), 0.2)
    x, y = np.mgrid[-5.5:6, -5.5:6].reshape(2, -1)
    places = np.stack([x, y, 0 * x + 7.5], axis=-1)[np.hypot(x, y) < 6]
    assert len(places) > 100
    needles = [Mesh(p + 0.02 * ball(3).vertices * (1, 1, 12), ball(3).faces) for p in places]
    options = ClosingOptions(floor=None, top=None, holes=how)
    for mesh, refused in ((mouth, False), (join([mouth, *needles]), True)):
        done, said = close(mesh, options)
        assert soundness(done) == []
        assert same_measured(mesh, done)
        assert is_closed(done) != refused
        found = holes(mesh)
        words = zip(
            (h.centre[2] > 0 for h in found), closings(mesh, found, options, done), strict=True
        )
        assert dict(words) == {True: "open" if refused else how, False: how}
        told = [f for f in said if f.code == "surface.unfilled"]
        assert len(told) == refused
    assert told[0].message.startswith("1 gap(s) up to")
    assert told[0].where.endswith(" mm")
    assert "1 gaps closed" in said[-1].message


@pytest.mark.parametrize(("steps", "lines"), [(1, 9), (9, 1), (4, 6), (2, 2)])
def test_a_grid_without_a_face_is_said_and_closing_it_does_nothing(steps, lines):
    missing = 1.0 if (steps, lines) != (1, 9) else 0.0
    grid = random_grid(3, steps, lines, missing, False, 0.0)
    made = to_mesh([grid], Settings(caps=ClosingOptions()))
    mesh, said = made.mesh, made.findings
    assert not len(mesh.faces)
    assert [f.code for f in said if f.severity != "note"] == ["surface.none"]
    assert holes(mesh) == []


@pytest.mark.slow
def test_the_same_mesh_gives_the_same_bytes_whatever_the_threads_and_hashes():
    code = (
        "import hashlib\n"
        "from tests.mesh.open_meshes import ball, opened\n"
        "from turnscan.surface.holes import ClosingOptions, close\n"
        "mesh = opened(ball(24, 0.1, 5), [0.2, 0.1, 1.0], 0.8)\n"
        "done, said = close(mesh, ClosingOptions(floor=-9.9, reach=2.0, holes='curvature'))\n"
        "print(hashlib.sha256(done.vertices.tobytes() + done.faces.tobytes()).hexdigest(), said)\n"
    )
    seen = set()
    for seed, threads in (("1", "1"), ("7", "2")):
        threading = dict.fromkeys(("OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), threads)
        env = {**os.environ, "PYTHONHASHSEED": seed, **threading}
        run = [sys.executable, "-c", code]
        seen.add(subprocess.run(run, env=env, check=True, capture_output=True, text=True).stdout)
    assert len(seen) == 1
    assert "surface.caps" in seen.pop()


@pytest.mark.parametrize("top", ["plane", "fan", "smooth", "open"])
def test_the_top_is_closed_as_asked_for(top):
    """A tapered tube about the axis, from 1 mm above the platter up, with a dent in its side."""
    around, up = 60, 24
    phi, z = np.meshgrid(2 * np.pi * np.arange(around) / around, 1 + np.arange(up) * 1.0)
    radius = 12.0 - 0.2 * z
    vertices = np.stack([radius * np.cos(phi), radius * np.sin(phi), z], axis=-1).reshape(-1, 3)
    faces = []
    for j in range(up - 1):
        for i in range(around):
            a, b = j * around + i, j * around + (i + 1) % around
            if not (10 <= j < 13 and 5 <= i < 8):
                faces += [[a, b, b + around], [a, b + around, a + around]]
    tube = Mesh(vertices, np.array(faces))
    done, said = close(tube, ClosingOptions(top=top))
    assert soundness(done) == []
    assert np.array_equal(done.vertices[: len(tube.vertices)], tube.vertices)
    assert np.array_equal(done.faces[: len(tube.faces)], tube.faces)
    assert done.measured[: len(tube.faces)].all()
    assert len(holes(done)) == (1 if top == "open" else 0)
    rim = 1 + (up - 1) * 1.0
    lid = done.vertices[len(tube.vertices) :]
    apex = lid[np.hypot(lid[:, 0], lid[:, 1]) < 1e-9]
    if top == "fan":
        assert apex.tolist() == [[0.0, 0.0, rim]]
    if top == "smooth":
        assert rim + 0.5 < done.bounds[1, 2] < rim + 30, "goes on inward and up, and comes round"
    if top in ("plane", "fan"):
        assert done.bounds[1, 2] == rim
        # A frustum down to the platter, its foot led on outward.
        n = around / 2 * np.sin(2 * np.pi / around)
        low, high = 12.0, 12.0 - 0.2 * rim
        assert done.volume == pytest.approx(n * rim / 3 * (low**2 + low * high + high**2), rel=2e-3)
    assert "surface.floor" in [f.code for f in said]


def can_be_spanned(taken: np.ndarray) -> bool:
    """Whether triangles between the vertices of a loop avoid all chords that are taken (m, m)."""
    m = len(taken)
    good = np.zeros((m, m), dtype=bool)
    for width in range(1, m):
        for i in range(m - width):
            k = i + width
            free = width in (1, m - 1) or not taken[i, k]
            good[i, k] = free and (
                width == 1 or any(good[i, j] and good[j, k] for j in range(i + 1, k))
            )
    return bool(good[0, m - 1])


@settings(max_examples=200)
@given(m=st.integers(3, 12), share=st.floats(0.0, 1.0), seed=st.integers(0, 10_000))
def test_a_loop_is_spanned_without_chords_that_are_taken_or_not_at_all(m, share, seed):
    """Where none is free nothing is written: it was, beyond the end of what was made for it."""
    rng = np.random.default_rng(seed)
    taken = rng.random((m, m)) < share
    taken |= taken.T
    points, outer = rng.normal(size=(2, m, 3))
    for bent in (False, True):
        faces, sound = _patch_kernels.span(points, outer, taken, bent)
        assert sound == can_be_spanned(taken)
        if not sound:
            continue
        a, b = faces[:, [0, 1, 2]].ravel(), faces[:, [1, 2, 0]].ravel()
        border = ((b - a) % m == 1) | ((a - b) % m == 1)
        assert border.sum() == m
        assert not taken[a[~border], b[~border]].any()


@pytest.mark.parametrize("m", [5, 450])
def test_a_loop_all_of_whose_chords_are_taken_is_filled_from_its_middle(m):
    """A long one, too, which is spanned in parts."""
    turn = 2 * np.pi * np.arange(m) / m
    points = np.c_[np.cos(turn), np.sin(turn), np.zeros(m)]
    ring, taken = np.arange(m, dtype=np.int32), np.ones((m, m), dtype=bool)
    done = _fill._patch(ring, points, 2 * points, np.ones(m), taken, "membrane")
    assert len(done.faces) == m
    assert (done.faces == m).sum() == m


@settings(max_examples=20)
@given(m=st.integers(400, 900), share=st.sampled_from([0.0, 0.02, 0.3]), seed=st.integers(0, 999))
def test_a_long_loop_has_no_chord_that_is_taken(m, share, seed):
    """Not between the ends of its parts, either."""
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * np.arange(m) / m
    points = np.c_[np.cos(turn), np.sin(turn), 0.1 * np.sin(5 * turn)]
    taken = np.zeros((m, m), dtype=bool)
    near = np.arange(m)[rng.random(m) < share]
    ahead = (near + rng.integers(2, 6, len(near))) % m
    taken[near, ahead] = taken[ahead, near] = True
    faces, sound = _fill._spanned(points, 2 * points, taken, bent=False)
    assert sound or share > 0.1, "a part between two cuts may have no other chords"
    if sound:
        assert len(faces) == m - 2
        assert not taken[faces, np.roll(faces, -1, axis=1)].any()
