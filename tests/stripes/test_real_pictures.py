"""Pictures of real scanners made by others; skipped where they are absent."""

from __future__ import annotations

from pathlib import Path

import pytest
from bench import real_stripes as real


def test_the_bust_has_its_stripe_in_1100_rows(shared_data: Path) -> None:
    total, on_bust, rim = real.bust(shared_data)
    assert total >= 1100
    # The laser really is there: 1066 rows on the bust (54-1119), 49 on the rim of the table.
    assert on_bust >= 1060
    assert 45 <= rim <= 60
    assert total - on_bust - rim < 40  # what is left: the faint line on the black platter


@pytest.mark.parametrize(
    ("lit", "dark"), [("img_5014.jpg", "img_5013.jpg"), ("img_5397.jpg", "img_5396.jpg")]
)
def test_on_glossy_ceramic_the_core_is_found_and_not_the_halo(
    shared_data: Path, lit: str, dark: str
) -> None:
    figures = real.ceramic(shared_data, lit, dark)
    assert figures["weight of green"] > figures["weight of red"]  # red is clipped and glows
    assert figures["rows found of 530"] >= 520
    assert figures["px from the middle of the core, median"] < 0.5
    assert figures["px, 95 %"] < 4
    assert figures["width of the stripe, rms px"] < 7
    assert figures["width of the red glow, px"] > 50
    assert figures["steps above 3 px between rows"] < 25
    assert 0.005 < figures["noise along the stripe, px"] < 0.1


@pytest.mark.parametrize(("name", "shift"), [("grey_step_3.68mm", 20.2), ("grey_step_14mm", 84.4)])
def test_a_step_shifts_the_stripe_repeatably(shared_data: Path, name: str, shift: float) -> None:
    figures = real.blocks(shared_data, name)
    assert figures["distinct frames"] >= 5
    assert abs(figures["shift, px"] - shift) < 1
    assert figures["rms of the shift over the frames, px"] < 0.02 * shift
    assert figures["noise along the stripe on the bed, px"] < 0.05
    assert figures["noise along the clipped stripe on the block, px"] < 0.1


@pytest.mark.parametrize("number", range(6))
def test_a_green_line_without_laser_off_picture(shared_data: Path, number: int) -> None:
    figures = real.green_board(shared_data, number)
    assert figures["rows on the board of 180"] >= 178
    assert figures["rms from a parabola, px"] < 0.6  # the board is bent
    assert figures["noise along the stripe, px"] < 0.1


def test_the_line_on_both_charuco_boards(shared_data: Path) -> None:
    for lit in sorted((shared_data / "charuco-pairs").glob("*_laser.png")):
        figures = real.charuco(shared_data, lit)
        assert figures["rows found"] >= 1050
        assert figures["ambiguous"] <= 25
        assert figures["noise along the stripe, px"] < 0.2
