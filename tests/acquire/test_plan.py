"""The plan: exact angles, every option, strictly read back."""

from __future__ import annotations

import json
import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.acquire.rig import plan_of
from turnscan.acquire import (
    Acquisition,
    Exposure,
    Plan,
    Texture,
    acquisition_from_json,
    acquisition_to_json,
    turn_of,
)
from turnscan.errors import FormatError, InputError, TurnscanError

RICH = plan_of(
    stops=7, start_deg=Fraction(-100, 3), passes=3, together=True, dark_every=4,
    exposures=(Exposure(0.01), Exposure(0.04, 2.0)), settle=0.1, blind_steps=3,
    texture=Texture(Exposure(0.2), 5, ("lamp",)),
)  # fmt: skip


def test_a_plan_comes_back_the_same() -> None:
    what = Acquisition(RICH, "sim:cup", "grbl:/dev/ttyUSB0", "grbl:/dev/ttyUSB0")
    assert acquisition_from_json(acquisition_to_json(what), "here") == what
    plain = Acquisition(turn_of(400, ("a",), 0.02), "a", "b", "c")
    assert acquisition_from_json(acquisition_to_json(plain), "here") == plain


@given(
    change=st.sampled_from(
        [
            ("step_deg", "1e5"), ("step_deg", "1/0"), ("step_deg", 3.5), ("stops", 0),
            ("stops", "7"), ("stops", 10**7), ("lasers", []), ("lasers", ["a", "a"]),
            ("exposures", []), ("exposures", [{"seconds": -1.0, "gain": 1.0}]),
            ("passes", True), ("dark_every", -1), ("settle", -0.5), ("texture", {}),
            ("unknown", 1), ("together", None), ("blind_steps", -3),
        ]
    )
)  # fmt: skip
def test_what_is_not_a_plan_is_refused(change: tuple[str, object]) -> None:
    body = json.loads(acquisition_to_json(Acquisition(RICH, "a", "b", "c")))
    body["plan"][change[0]] = change[1]
    with pytest.raises((FormatError, InputError)):
        acquisition_from_json(json.dumps(body), "here")
    with pytest.raises(FormatError):
        acquisition_from_json("{", "here")
    with pytest.raises(FormatError, match="version"):
        acquisition_from_json(json.dumps({**body, "version": 2}), "here")


@given(
    st.fractions(Fraction(-400), Fraction(400), max_denominator=10_000),
    st.fractions(Fraction(-90), Fraction(90), max_denominator=10_000).filter(bool),
    st.integers(1, 500),
    st.integers(1, 3),
)
def test_angles_are_exact_and_always_go_on(
    start: Fraction, step: Fraction, stops: int, passes: int
) -> None:
    try:
        plan = plan_of(stops, start_deg=start, step_deg=step, passes=passes)
    except TurnscanError:
        assert abs(start) + abs(step) * stops * passes + 720 * passes > 360_000
        return
    for k in (0, stops - 1, plan.steps - 1):
        exact = plan.degrees(k)
        assert (exact - start - step * (k % stops)) % 360 == 0
        assert math.isclose(plan.angle(k), math.radians(exact), rel_tol=1e-15, abs_tol=1e-15)
    way = [plan.degrees(k) * (1 if step > 0 else -1) for k in range(plan.steps)]
    assert way == sorted(set(way)), "the table never turns back"


def test_an_even_turn_closes() -> None:
    plan = turn_of(7, ("a",), 0.02)
    assert plan.degrees(6) + plan.step_deg == 360
    assert plan_of(7, step_deg=Fraction(360, 7), passes=2).degrees(7) == 360
    assert plan_of(5, start_deg=Fraction(30), step_deg=Fraction(-6), passes=2).degrees(5) == -330


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"stops": 0}, "0 steps"), ({"stops": 10**7}, "10000000 steps"),
        ({"step_deg": Fraction(0)}, "steps of 0°"), ({"lasers": ()}, "lasers none"),
        ({"lasers": ("a", "a")}, "name each laser once"), ({"exposures": ()}, "one exposure"),
        ({"step_deg": Fraction(90_000)}, "at most 1000 turns"),
        ({"lasers": ("a+b", "c"), "together": True}, r"\+ in its name"),
        ({"settle": math.nan}, "settle"), ({"passes": 0}, "0 passes"),
    ],
)  # fmt: skip
def test_impossible_plans_say_why(change: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        plan_of(**change)  # type: ignore[arg-type]


def test_an_exposure_is_possible() -> None:
    for seconds in (0.0, -1.0, math.nan, math.inf, 61.0):
        with pytest.raises(InputError, match="exposure"):
            Exposure(seconds)
    with pytest.raises(InputError, match="gain"):
        Exposure(0.1, 0.0)
    with pytest.raises(InputError, match="texture"):
        Texture(Exposure(0.1), 0)
    assert Plan(Fraction(0), 1, ("a",), (Exposure(1.0),)).steps == 1
