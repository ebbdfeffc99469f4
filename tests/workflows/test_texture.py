"""Texture pictures in scan files: their colours reach surfaces, files and sessions."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tests.texture.painted import paint
from tests.workflows.scans import CAN_RIG, write_can
from turnscan.arrays import Floats
from turnscan.cli import turnscan
from turnscan.errors import InputError
from turnscan.formats import read_mesh
from turnscan.mesh import Mesh, measured_vertices
from turnscan.progress import no_progress
from turnscan.rig import TableMotion
from turnscan.scan import Frame, Scan, ScanPlan
from turnscan.texture import NEUTRAL, Colours, TexturePicture, colours_of
from turnscan.workflows import ScanOptions, ScanSession, reconstruct, simulate
from turnscan.workflows._surface import _texture


def bands(points: Floats) -> Floats:
    """Grey levels of a part that darkens upwards."""
    return np.asarray(190.0 - 2.5 * points[:, 2])


@pytest.fixture(scope="module")
def can(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = write_can(tmp_path_factory.mktemp("textures") / "can.turnscan")
    whole = reconstruct(path, close=True).mesh
    assert whole.colour is None
    paint(path, whole, bands, every=4)
    return path


def test_a_surface_has_the_colours_of_its_texture_pictures(can: Path, tmp_path: Path) -> None:
    part = reconstruct(can, close=True)
    assert part.mesh.colour is not None
    own = measured_vertices(part.mesh) & (part.mesh.colour != NEUTRAL).any(axis=1)
    assert own.sum() > 0.9 * measured_vertices(part.mesh).sum()
    off = np.abs(part.mesh.colour[own, 0] - bands(part.mesh.vertices[own]))
    assert np.median(off) < 1.0
    assert np.quantile(off, 0.99) < 8.0
    assert "texture.colour" in {f.code for f in part.findings}
    assert reconstruct(can, no_colour=True).mesh.colour is None

    files = [tmp_path / f"can{suffix}" for suffix in (".ply", ".obj", ".glb", ".3mf", ".stl")]
    words = [w for path in files for w in ("-o", str(path))]
    done = CliRunner().invoke(turnscan, ["export", str(can), *words, "--decimate", "2000"])
    assert done.exit_code == 0, done.output
    for path in files[:-1]:
        read = read_mesh(path.read_bytes(), path.suffix)
        assert read.colour is not None, path
        seen = (read.colour != NEUTRAL).any(axis=1)
        assert np.median(np.abs(read.colour[seen, 0] - bands(read.vertices[seen]))) < 2.0


def test_a_session_shows_and_exports_the_same_colours(can: Path, tmp_path: Path) -> None:
    path = tmp_path / "can.turnscan"
    shutil.copy(can, path)
    session = ScanSession(path, no_progress)
    try:
        assert session.textured
        state, arrays = session.colours(no_progress)
        _, surface = session.surface()
        assert arrays["colour"].shape == surface["positions"].shape
        seen = (arrays["colour"] != NEUTRAL).any(axis=1)
        assert np.median(np.abs(arrays["colour"][seen, 0] - bands(surface["positions"][seen]))) < 1
        out = session.result(state, no_progress).mesh
        assert out.colour is not None
        assert len(np.unique(out.colour, axis=0)) > 20
    finally:
        session.close()
    bare = write_can(tmp_path / "bare.turnscan")
    session = ScanSession(bare, no_progress)
    try:
        assert not session.textured
        with pytest.raises(InputError, match="no texture images"):
            session.colours(no_progress)
        assert session.result(session.now, no_progress).mesh.colour is None
    finally:
        session.close()


def test_a_picture_without_an_angle_gives_no_colour(can: Path, tmp_path: Path) -> None:
    path = write_can(tmp_path / "lost.turnscan")
    with Scan.open(can) as scan:
        picture = scan.texture(0).lit
    with Scan.resume(path) as scan:
        scan.forget("L0", 5)
        scan.add_missing(5, "L0", "taken away")
        scan.add_texture(5, picture)
        scan.add_texture(0, picture)  # the frame of its step knows the angle
    part = reconstruct(path)
    said = {f.code: f.message for f in part.findings}
    assert said["texture.no-angle"].startswith("1 texture pictures of lost.turnscan")
    assert "colour from 1 pictures" in said["texture.colour"]


@pytest.fixture
def used(monkeypatch: pytest.MonkeyPatch) -> list[TexturePicture]:
    """The pictures that colours are taken from, as they come."""
    out: list[TexturePicture] = []

    def look(mesh: Mesh, pictures: Iterable[TexturePicture], channels: int) -> Colours:
        out.extend(pictures)
        return colours_of(mesh, out, channels)

    monkeypatch.setattr(_texture, "colours_of", look)
    return out


SURFACE = Mesh(np.eye(3), [[0, 1, 2]])


def test_pictures_are_where_a_table_with_errors_of_its_own_really_was(
    can: Path, tmp_path: Path, used: list[TexturePicture]
) -> None:
    path = tmp_path / "between.turnscan"
    with Scan.open(can) as scan, Scan.create(path, scan.plan, CAN_RIG) as new:
        picture = scan.texture(0).lit
        for frame in scan.frames():
            if frame.step % 2:  # a picture at each other step: its own angle alone is known
                new.add(
                    replace(frame, measured=0.1, angle_sigma=1e-4) if frame.step == 5 else frame
                )
            else:
                new.add_texture(frame.step, picture, commanded=frame.commanded)
        new.add_texture(5, picture, commanded=frame.commanded)
    motion = TableMotion(np.array([[0.0, 0.05]]), start=0.02)
    rig = replace(CAN_RIG, motion=motion)
    with Scan.open(path) as scan:
        told = np.arange(24) * 2 * np.pi / 24
        told[5] = 0.1
        true = motion.angle(told)
        true[5] = told[5]  # what an encoder said needs no correction
        _texture.colours(SURFACE, [_texture.TextureSource(scan, rig)], no_progress)
        steps = list(scan.texture_angles)
    assert steps == sorted([*range(0, 24, 2), 5])
    for step, shot in zip(steps, used, strict=True):
        turn = rig.T_camera_table.rotation.T @ shot.T_camera_object.rotation
        off = np.arctan2(turn[1, 0], turn[0, 0]) - true[step]
        assert abs((off + np.pi) % (2 * np.pi) - np.pi) < 1e-9, step


@pytest.mark.parametrize(("stripe", "white"), [(3900, 4095.0), (60000, 65535.0)])
def test_stripes_tell_the_scale_of_dark_pictures_of_more_than_8_bits(
    stripe: int, white: float, tmp_path: Path, used: list[TexturePicture]
) -> None:
    path = tmp_path / "dark.turnscan"
    plan = ScanPlan(320, 240, "uint16", 1, ("L0",), 2, 12.0)
    lit = np.full((240, 320), 40, np.uint16)
    dark = lit.copy()
    lit[:, 150:156] = stripe
    with Scan.create(path, plan, CAN_RIG) as scan:
        scan.add(Frame(0, "L0", lit, dark, commanded=0.0))
        scan.add_texture(0, np.full((240, 320), 900, np.uint16))
    with Scan.open(path) as scan:
        _texture.colours(SURFACE, [_texture.TextureSource(scan, CAN_RIG)], no_progress)
    assert [shot.white for shot in used] == [white]


def test_texture_images_that_are_counted_but_not_captured_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="every 4 steps") as refused:
        ScanOptions(texture_every=4).request()
    assert [option.name for option in refused.value.hint.options] == ["texture"]
    assert ScanOptions(texture=0.01, texture_every=4).request().texture_every == 4
    with pytest.raises(InputError, match="every 4 steps"):
        simulate("sphere", tmp_path / "ball.turnscan", texture_every=4)
    assert not list(tmp_path.iterdir())
