"""The surface's part of a report: what it says of holes."""

from __future__ import annotations

import re

from tests.surface.bars import leaning_bar
from turnscan.pipeline import Reconstruction
from turnscan.surface.holes import CAUSE_WORDS
from turnscan.workflows._surface._surface_report import surface_figures, surface_parts


def test_a_hole_of_two_causes_says_both_in_json_and_on_the_page() -> None:
    mesh, view = leaning_bar()
    done = Reconstruction((view.grid,), mesh, (), sought=(view,))
    told = [(h["cause"], h["also"]) for h in surface_figures(done)["holes"]]
    assert told == [(h.cause, h.also) for h in done.holes]
    both = [h for h in done.holes if h.also is not None]
    assert both
    page = "".join(surface_parts(done))
    for hole in both:
        cells = rf"<td>{CAUSE_WORDS[hole.cause]}; in part {CAUSE_WORDS[hole.also]}</td>"
        assert re.search(cells, page)
