"""Rays are saved where a print has one tone: the light of each pixel stays what it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from turnscan.arrays import Singles
from turnscan.simulate import Renderer, bench, spec_of
from turnscan.simulate import _print as prints
from turnscan.simulate._scene import Texture


def light(renderer: Renderer, monkeypatch: pytest.MonkeyPatch) -> tuple[Singles, Singles, float]:
    """The room's light by few rays and by many, and the share of the print where few suffice."""
    shares: list[float] = []
    plain = prints.plain

    def counted(texture, points, *more):
        found = plain(texture, points, *more)
        (x, y, off), (h, w) = texture.places(points), texture.picture.shape
        shares.append(found[~off & (x > 0) & (x < w - 1) & (y > 0) & (y < h - 1)].mean())
        return found

    def none(texture, points, *_):
        return np.zeros(len(points), np.bool_)

    made = renderer.bench
    T = made.rig.T_camera_table @ made.motion.pose(0.3)
    monkeypatch.setattr(prints, "plain", counted)
    few = renderer.view.room_light(T)
    renderer.view._ambient = None
    monkeypatch.setattr(prints, "plain", none)
    return few, renderer.view.room_light(T), shares[0]


@pytest.mark.parametrize("shown", ["charuco", "chessboard"])
def test_a_board_has_the_light_that_many_rays_give(
    shown: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec, _ = spec_of(f"sim:{shown}?room=0.5&rig=paper&lasers=1")
    few, many, share = light(Renderer(bench(spec)), monkeypatch)
    assert np.abs(few / many - 1).max() < 2e-6
    assert 0.4 < share < 0.95


def test_a_print_of_fine_detail_is_looked_at_with_many_rays(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    spec, _ = spec_of("sim:charuco?room=0.5&rig=paper&lasers=1")
    made = bench(spec)
    body, *others = made.scene.bodies
    assert body.texture is not None
    dots = np.ones_like(body.texture.picture)
    dots[::7, ::7] = 0.0  # each is less than a tenth of a pixel
    bodies = (replace(body, texture=replace(body.texture, picture=dots)), *others)
    made = replace(made, scene=replace(made.scene, bodies=bodies))
    few, many, share = light(Renderer(made), monkeypatch)
    assert share == 0.0
    assert np.abs(few / many - 1).max() < 2e-6


def test_room_ends_where_the_tone_changes() -> None:
    picture = np.ones((20, 40))
    picture[:, 20:] = 0.2
    texture = Texture(picture, np.zeros(3), np.array([40.0, 0, 0]), np.array([0, 20.0, 0]))
    x = np.array([2.0, 15.0, 19.0, 30.0, 39.0, 45.0], np.float32)
    assert texture.room(x, np.full(6, 10.0, np.float32)).tolist() == [17, 4, 0, 9, 0, 6]
