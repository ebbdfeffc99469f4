"""Scans that are being opened, as browsers meet them."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.web.running import PATIENCE, Browser, serving
from turnscan.workflows._session import _first as _session_first
from turnscan.workflows._session import _session


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Until it is set, no scan comes to its whole surface; all are worth a preview."""
    go, build = threading.Event(), _session.build

    def wait(*args: Any, **keys: Any) -> Any:
        assert go.wait(PATIENCE)
        return build(*args, **keys)

    monkeypatch.setattr(_session, "build", wait)
    monkeypatch.setattr(_session_first, "WORTH_IT", 0)
    return go


def test_a_part_of_a_large_scan_is_shown_before_it_is_open_also_to_who_comes_later(
    folder: Path, held: threading.Event
) -> None:
    with serving(folder) as server, Browser(server) as one, Browser(server) as two:
        scan = one.hello["scans"][0]["scan"]
        assert one.ask("open", scan=scan)["kind"] == "started"
        shown = one.once("first_surface")
        assert (shown["scan"], shown["every"], shown["edits"]) == (scan, 1, 0)
        positions, faces = shown["arrays"]["positions"], shown["arrays"]["faces"]
        assert len(faces) > 500
        assert faces.max() < len(positions)
        assert np.isfinite(positions).all()
        refused = one.ask("edit", scan=scan, base_revision=0, edit={"kind": "delete"})
        assert refused["kind"] == "refused", "there is nothing to edit yet"
        with Browser(server) as late:
            assert late.ask("open", scan=scan)["kind"] == "started"
            np.testing.assert_array_equal(
                late.once("first_surface")["arrays"]["positions"], positions
            )
        assert not [m for m in one.heard if m["kind"] == "opened"]
        held.set()
        for browser in (one, two):
            assert browser.once("opened")["figures"]["faces"] > 500
        assert server.workshop._first == {}
        assert one.ask("open", scan=scan)["kind"] == "opened"
        assert sum(m["kind"] == "first_surface" for m in one.heard) == 1
