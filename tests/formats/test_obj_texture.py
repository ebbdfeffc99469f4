"""The texture beside an OBJ shows the colours of its vertices, also to another reader."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow

from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.formats import ExportOptions, read_mesh
from turnscan.mesh import Mesh
from turnscan.workflows import save

OPTIONS = ExportOptions(texture=True)


def _coloured(faces: int, seed: int = 1) -> Mesh:
    dice = np.random.default_rng(seed)
    X = dice.normal(size=(faces + 2, 3)) * 20
    strip = np.arange(faces)[:, None] + [0, 1, 2]
    colour = dice.integers(0, 256, (len(X), 3)).astype(np.uint8)
    return Mesh(X, strip, colour=colour)


def _sampled(picture: Floats, uv: Floats) -> Floats:
    """(n, 3) levels between the middles of texels, as a graphics card takes them."""
    high, wide = picture.shape[:2]
    x, y = uv[:, 0] * wide - 0.5, (1 - uv[:, 1]) * high - 0.5
    i, j = np.floor(x + 1e-6).astype(int), np.floor(y + 1e-6).astype(int)
    a, b = (x - i)[:, None], (y - j)[:, None]
    i2, j2 = np.minimum(i + 1, wide - 1), np.minimum(j + 1, high - 1)
    low = (1 - a) * picture[j, i] + a * picture[j, i2]
    top = (1 - a) * picture[j2, i] + a * picture[j2, i2]
    return np.asarray((1 - b) * low + b * top)


@pytest.mark.parametrize("faces", [1, 2, 7, 500])
def test_the_texture_is_the_colour_of_the_vertices_everywhere_on_a_face(
    tmp_path: Path, faces: int
) -> None:
    mesh = _coloured(faces)
    assert not save({tmp_path / "part.obj": mesh}, OPTIONS)
    lines = (tmp_path / "part.obj").read_text().splitlines()
    assert "mtllib part.mtl" in lines
    assert "map_Kd part-texture.png" in (tmp_path / "part.mtl").read_text()
    places = np.array([line.split()[1:] for line in lines if line.startswith("vt ")], dtype=float)
    corners = [[c.split("/") for c in n.split()[1:]] for n in lines if n.startswith("f ")]
    at = np.array(corners, dtype=int) - 1
    np.testing.assert_array_equal(at[..., 0], mesh.faces)
    picture = np.asarray(Pillow.open(tmp_path / "part-texture.png"), dtype=float)
    assert mesh.colour is not None
    level = mesh.colour.astype(float)
    for weights in ([1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0.5, 0.5], [0.3, 0.3, 0.4]):
        uv = np.einsum("k,fkj->fj", weights, places[at[..., 1]])
        there = np.einsum("k,fkj->fj", weights, level[mesh.faces])
        # Between texels of which some are cut off at black or white it may be off.
        assert np.abs(_sampled(picture, uv) - there).max() < (1.0 if max(weights) == 1 else 70)
        assert np.median(np.abs(_sampled(picture, uv) - there)) < 1.0


def test_another_program_reads_it(tmp_path: Path) -> None:
    import trimesh

    mesh = _coloured(60)
    save({tmp_path / "part.obj": mesh}, OPTIONS)
    read = trimesh.load(tmp_path / "part.obj", process=False)
    assert len(read.faces) == 60
    image = np.asarray(read.visual.material.image.convert("RGB"), dtype=float)
    seen = _sampled(image, np.asarray(read.visual.uv)[read.faces[:, 0]])
    first = np.asarray(read.vertices)[read.faces[:, 0]]
    which = np.linalg.norm(first[:, None] - mesh.vertices, axis=2).argmin(axis=1)
    assert mesh.colour is not None
    assert np.abs(seen - mesh.colour[which]).max() < 1.0


def test_colours_and_fillings_are_read_back(tmp_path: Path) -> None:
    mesh = _coloured(40)
    filled = np.arange(40) % 7 < 4
    save({tmp_path / "part.obj": Mesh(mesh.vertices, mesh.faces, colour=mesh.colour,
                                      measured=filled)}, OPTIONS)  # fmt: skip
    back = read_mesh((tmp_path / "part.obj").read_bytes(), ".obj")
    assert mesh.colour is not None
    assert back.colour is not None
    np.testing.assert_array_equal(back.colour, mesh.colour)
    np.testing.assert_array_equal(back.measured, filled)


def test_there_is_a_texture_only_where_it_is_asked_for_and_has_colours(tmp_path: Path) -> None:
    mesh = _coloured(10)
    plain = Mesh(mesh.vertices, mesh.faces)
    save({tmp_path / "a.obj": mesh})
    save({tmp_path / "b.obj": plain, tmp_path / "c.ply": mesh}, OPTIONS)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.obj", "b.obj", "c.ply"]
    assert b"mtllib" not in (tmp_path / "b.obj").read_bytes()


def test_a_name_that_an_obj_cannot_say_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="blank"):
        save({tmp_path / "my part.obj": _coloured(10)}, OPTIONS)
    assert not list(tmp_path.iterdir())


def test_the_picture_is_the_same_each_time(tmp_path: Path) -> None:
    for name in ("a", "b"):
        save({tmp_path / f"{name}.obj": _coloured(30)}, OPTIONS)
    one, two = ((tmp_path / f"{name}-texture.png").read_bytes() for name in ("a", "b"))
    assert one == two
    assert Pillow.open(BytesIO(one)).mode == "RGB"
