"""Detectors of other packages: found by name, checked by a kit, contained when they fail."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import turnscan as ts
from tests.package import install_package
from tests.workflows.scans import write_can
from turnscan.cli import main
from turnscan.errors import InputError, PluginError
from turnscan.plugins import Plugin
from turnscan.stripes import Candidates, Stripe, StripeSettings, detect, find_candidates
from turnscan.testing import check_detector

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "add-a-detector.md"


def ours(lit: Any, dark: Any, settings: StripeSettings) -> Stripe:
    return detect(lit, dark, settings)


Run = Callable[[list[str]], tuple[object, str]]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    """The command line with these words: its exit code, and what it says on stderr."""

    def called(words: list[str]) -> tuple[object, str]:
        monkeypatch.setattr(sys, "argv", ["turnscan", *words])
        code: object = 0
        try:
            main()
        except SystemExit as ended:
            code = ended.code
        return code, capfd.readouterr().err

    return called


@pytest.fixture
def gravity(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The package of the page, installed; the code of its test."""
    blocks = re.findall(r"```(\w+)\n(.*?)```", PAGE.read_text(), re.S)
    sources = [text for language, text in blocks if language == "python"]
    (entry,) = (text for language, text in blocks if language == "toml")
    code = [line for line in sources[0].splitlines() if line.strip()]
    assert len(code) <= 30, f"{len(code)} lines"
    install_package(tmp_path / "site", "turnscan_gravity", sources[0], entry, monkeypatch)
    return sources[1]


def test_the_example_of_the_page_passes_its_own_check(gravity: str) -> None:
    namespace: dict[str, Any] = {}
    exec(gravity, namespace)
    namespace["test_my_detector"]()


@pytest.mark.usefixtures("gravity")
def test_by_its_name_it_makes_a_surface_through_every_door(tmp_path: Path, run: Run) -> None:
    scan = write_can(tmp_path / "cup.turnscan")
    out, report = tmp_path / "cup.ply", tmp_path / "cup.json"
    words = ["reconstruct", str(scan), "-o", str(out), "--strategy", "gravity"]
    code, said = run([*words, "--report", str(report)])
    assert not code, said
    told = json.loads(report.read_text())["parameters"]["stripes"]["strategy"]
    assert told == "gravity (turnscan_gravity 1.0, turnscan_gravity:gravity)"
    with ts.open_scan(scan) as opened:
        assert ts.options_of(opened).strategy == "gravity"
        by_name = opened.stripes()
        with_scatter = [by_name.stripe(k).scatter for k in range(len(by_name))]
        assert np.array_equal(with_scatter, by_name.scatter, equal_nan=True)
        import turnscan_gravity  # type: ignore[import-not-found]

        by_hand = opened.stripes(detector=turnscan_gravity.gravity)
        window = opened.stripes(strategy="window")
    assert np.array_equal(by_name.position, by_hand.position, equal_nan=True)
    both = by_name.found & window.found
    assert both.sum() > 0.95 * window.found.sum()
    assert 0.001 < np.abs(by_name.position - window.position)[both].mean() < 0.3
    part = ts.reconstruct(scan, detector=turnscan_gravity.gravity, strategy="window")
    assert part.about["parameters"]["stripes"]["strategy"] == "turnscan_gravity:gravity"
    assert len(part.points) == pytest.approx(len(ts.reconstruct(scan).points), rel=0.02)


def test_a_name_that_nobody_has_is_refused_with_those_there_are(gravity: str, run: Run) -> None:
    with pytest.raises(InputError, match="gravitas"):
        StripeSettings(strategy="gravitas")
    with pytest.raises(InputError, match=r"window.*gravity"):
        ts.ReconstructOptions(strategy="gravitas")
    code, said = run(["reconstruct", "no.turnscan", "-o", "a.stl", "--strategy", "gravitas"])
    assert code == 2
    assert "gravity" in said
    assert "Traceback" not in said


BROKEN = {
    "at_import": "raise RuntimeError('no such library')",
    "at_exit": "raise SystemExit(3)",
    "no_function": "detect = 7",
    "at_use": "def detect(lit, dark, settings): return 1 / 0",
    "odd": "def detect(lit, dark, settings): return lit",
}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("at_import", "RuntimeError: no such library"),
        ("at_exit", "SystemExit: 3"),
        ("no_function", "it gives a int, not a function"),
        ("at_use", "ZeroDivisionError: division by zero"),
        ("odd", "it returned a ndarray"),
    ],
)
def test_a_broken_package_ends_in_one_line_that_names_it(
    name: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = f'[project.entry-points."turnscan.detectors"]\n{name} = "broken_{name}:detect"\n'
    entry += f'window = "broken_{name}:detect"\n'
    install_package(tmp_path / "site", f"broken_{name}", BROKEN[name], entry, monkeypatch)
    lit = np.full((4, 130), 9, np.uint8)
    lit[:, 60:64] = 200
    with pytest.raises(PluginError) as caught:
        detect(lit, None, StripeSettings(strategy=name))
    assert f"{name} of broken_{name} 1.0 (broken_{name}:detect) failed: {words}" in str(
        caught.value
    )
    assert detect(lit, None, StripeSettings(strategy="window")).found.all()


def _with(change: Callable[[Stripe], Any]) -> Callable[..., Any]:
    return lambda lit, dark, settings: change(detect(lit, dark, settings))


WRONG: dict[str, Callable[..., Any]] = {
    "rows for a picture": lambda lit, dark, s: detect(lit[1:], dark[1:], s),
    "a centre at": _with(lambda s: replace(s, position=s.position + 150.0)),
    "sigma 0 of the centre": _with(lambda s: replace(s, sigma=s.sigma * 0)),
    "sigma nan of the centre": _with(lambda s: replace(s, sigma=s.sigma * np.nan)),
    "px off the stripe": _with(lambda s: replace(s, position=s.position + 3.0)),
    "would be honest": _with(lambda s: replace(s, sigma=s.sigma * 1000)),
    "found nothing": _with(lambda s: replace(s, position=s.position * np.nan)),
    "without any light": lambda lit, dark, s: detect(lit, dark, replace(s, threshold=1.0)),
    "another stripe each time": _with(
        lambda s: replace(s, position=s.position + np.random.default_rng().normal(0, 1e-3))
    ),
}  # fmt: skip


@pytest.mark.parametrize("words", WRONG)
def test_the_kit_says_what_is_wrong(words: str) -> None:
    with pytest.raises((AssertionError, PluginError), match=re.escape(words)):
        check_detector(WRONG[words])


def test_our_own_detector_passes_the_kit_by_name_and_as_a_function() -> None:
    by_name = check_detector("window")
    assert 0.001 < by_name.rms < 0.05
    assert by_name.found == 1.0
    assert check_detector(ours).rms == pytest.approx(by_name.rms, rel=0.3)


def test_candidates_are_ordered_and_the_faintest_left_out() -> None:
    v = np.arange(3)

    def three(lit: Any, dark: Any, settings: StripeSettings) -> Candidates:
        at = np.array([[90.0, 10.0, 50.0], [20.0, np.nan, np.nan], [np.nan] * 3])
        light = np.array([[5.0, 9.0, 7.0], [1.0, np.nan, np.nan], [np.nan] * 3])
        return Candidates(at, at * 0 + 0.1, light, at * 0 + 1, np.zeros(at.shape, np.uint16))

    lit = np.zeros((3, 130), np.uint8)
    found = find_candidates(lit, lit, StripeSettings(strategy=three, max_candidates=2))
    assert found.position[0].tolist() == [10.0, 50.0]
    assert found.position[1, 0] == 20.0
    assert np.isnan(found.position[2]).all()
    stripe = detect(lit, lit, StripeSettings(strategy=three, electrons_per_dn=1.0))
    assert stripe.position[v[:2]].tolist() == [10.0, 20.0]
    assert not stripe.found[2]


def test_what_a_detector_is_told() -> None:
    seen: list[tuple[Any, Any, StripeSettings]] = []

    def spy(lit: Any, dark: Any, settings: StripeSettings) -> Stripe:
        seen.append((lit, dark, settings))
        return detect(lit, dark, settings)

    lit = np.full((50, 40), 9, np.uint8)
    lit[20, :] = 200
    asked = StripeSettings(strategy=spy, orientation="horizontal", roi=(5, 0, 30, 50))
    found = detect(lit, None, asked)
    (picture, dark, told), *_ = seen
    assert picture.shape == dark.shape == (40, 50)
    assert not picture.flags.writeable
    assert (picture[5:30, 20] == 200).all()
    assert (picture[:5] == dark[:5]).all()
    assert told.orientation == "vertical"
    assert told.background is not None
    assert told.threshold is not None
    assert isinstance(told.strategy, str)
    assert found.orientation == "horizontal"
    assert found.found.nonzero()[0].tolist() == list(range(5, 30))


def test_a_plugin_says_where_it_comes_from(gravity: str) -> None:
    plugin = StripeSettings(strategy="gravity").strategy
    assert isinstance(plugin, Plugin)
    assert str(plugin) == "gravity (turnscan_gravity 1.0, turnscan_gravity:gravity)"
