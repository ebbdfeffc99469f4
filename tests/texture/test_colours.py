"""Colours of vertices against the paint of a simulated part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.texture.pillar import (
    AT,
    DRIFT,
    LEVELS,
    NOSE,
    PART,
    TURN,
    off,
    plain,
    shots,
    taken,
    truth,
    world,
)
from turnscan.mesh import Provenance
from turnscan.rig import Pose
from turnscan.texture import NEUTRAL, TexturePicture, colours_of, texture_findings


def test_colours_are_those_of_the_paint_within_the_noise() -> None:
    found = colours_of(PART, shots(taken()))
    some = plain() & found.seen
    assert some.sum() > 500
    error = off(found)[some]
    assert 0.0005 < np.median(error) < 0.004, "half a grey level of 255 is 0.002"
    assert np.quantile(error, 0.99) < 0.01
    assert found.gains == pytest.approx(1.0, abs=0.01)
    assert np.median(off(found)[NOSE & found.seen]) < 0.01


def test_what_stands_before_a_place_does_not_colour_it() -> None:
    found = colours_of(PART, shots(taken()))
    red = found.colour[:, 0] > 2.5 * found.colour[:, 1].astype(float)
    assert not red[~NOSE].any(), "nothing of the ball on the pillar"
    assert red[NOSE & found.seen].all()
    seen_once = colours_of(PART, shots(taken(), [0]))
    behind = ~NOSE & (np.hypot(*(PART.vertices[:, 1:] - AT[1:]).T) < 4.5)
    behind &= PART.vertices[:, 0] > 0
    assert behind.sum() > 10
    assert not (seen_once.seen | seen_once.blended)[behind].any(), "the ball hides it from there"
    assert (seen_once.colour[behind] == NEUTRAL).all()


def test_exposures_that_drift_by_a_fifth_are_levelled() -> None:
    pictures = taken(drift=True)
    found, as_taken = (colours_of(PART, shots(pictures), level=x) for x in (True, False))
    relative = found.gains / DRIFT[:, None]
    assert relative / relative.mean() == pytest.approx(1.0, abs=0.006)
    some = plain() & found.seen
    assert np.median(off(found)[some]) < 0.006
    assert np.median(off(found)[some]) < 0.5 * np.median(off(as_taken)[some]), "it was needed"


def test_a_lamp_at_one_side_is_no_drift_of_the_exposure() -> None:
    half = range(TURN // 2 + 1)
    found = colours_of(PART, shots(taken(lamp=0.4), half))
    trend = np.polyfit(half, np.log(found.gains[:, 1]), 1)[0] * len(half)
    assert abs(trend) < 0.08, "over half a turn the pictures keep their brightness"


def test_full_pixels_have_no_say_where_others_are_not() -> None:
    pictures = [p.copy() for p in taken()]
    for p in pictures[::2]:
        p[:] = int(LEVELS)
    found = colours_of(PART, shots(pictures), level=False)
    some = plain() & found.seen
    assert np.median(off(found)[some]) < 0.01


def test_added_vertices_take_the_colour_around_them_and_stay_marked() -> None:
    added = ~NOSE & (np.hypot(PART.vertices[:, 1], PART.vertices[:, 2] - 30) < 6)
    added &= PART.vertices[:, 0] < 0
    v = len(PART.vertices)
    laser = np.where(added, -1, 0)
    origin = Provenance(np.full(v, 0.02), laser, laser, laser, ("L0",))
    known = ~added[PART.faces].any(axis=1)
    part = replace(PART, provenance=origin, measured=known)
    found = colours_of(part, shots(taken()))
    assert found.blended[added].all()
    assert not found.seen[added].any()
    ring = np.unique(PART.faces[~known])
    ring = ring[~added[ring]]
    low, high = found.colour[ring].min(axis=0), found.colour[ring].max(axis=0)
    assert ((found.colour[added] >= low) & (found.colour[added] <= high)).all()


def test_what_no_picture_shows_is_said_and_grey() -> None:
    found = colours_of(PART, shots(taken(), [0]))
    hidden = PART.vertices[:, 0] < -10
    assert (found.colour[hidden] == NEUTRAL).all()
    said = {f.code: f for f in texture_findings(PART, found)}
    assert said["texture.unseen"].severity == "warning"
    share = 100 * (1 - (found.seen | found.blended).mean())
    assert f"{share:.1f} %" in said["texture.unseen"].message
    assert "texture.dark" not in said
    dim = colours_of(PART, shots([p // 16 for p in taken()]))
    assert "texture.dark" in {f.code for f in texture_findings(PART, dim)}
    red = replace(found, colour=np.broadcast_to(np.uint8([140, 15, 15]), found.colour.shape))
    assert "texture.dark" not in {f.code for f in texture_findings(PART, red)}


def test_grey_pictures_and_none_at_all() -> None:
    grey = [np.asarray(p.mean(axis=2), dtype=np.uint16) for p in taken()]
    found = colours_of(PART, shots(grey), channels=1)
    assert (found.colour[:, 0] == found.colour[:, 2]).all()
    assert (
        np.abs(found.colour[plain()] / 255.0 - truth()[plain()].mean(axis=1)[:, None]).mean() < 0.02
    )
    nothing = colours_of(PART, iter(()))
    assert (nothing.colour == NEUTRAL).all()
    assert not nothing.seen.any()
    with pytest.raises(ValueError, match="pixels"):
        TexturePicture(np.zeros((3, 3), np.uint8), world()[0].rig.camera, Pose(), 255.0)
