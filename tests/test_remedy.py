"""A remedy holds options as data; each door has its own words for them."""

from __future__ import annotations

import copy
import json
import pickle

from turnscan.cli._words import error_line, with_flags
from turnscan.errors import InputError
from turnscan.findings import Finding, findings_json
from turnscan.remedy import Option, Remedy

REMEDY = Remedy("give ", Option("dark"), ", or a lower ", Option("first_step", 4))


def test_options_are_data_and_words_are_the_doors() -> None:
    assert [(o.name, o.value) for o in REMEDY.options] == [("dark", None), ("first_step", 4)]
    assert str(REMEDY) == "give dark, or a lower first_step=4"
    finding = Finding("scan.odd", "note", "odd", remedy=REMEDY)
    assert str(with_flags(finding)).endswith("→ give --dark, or a lower --first-step 4")
    assert json.loads(findings_json([finding]))[0]["remedy"] == str(REMEDY)
    plain = Finding("scan.odd", "note", "odd", remedy="look at {it}")
    assert with_flags(plain) == plain


def test_an_error_knows_the_option_it_is_about() -> None:
    error = InputError("above\n255", hint=REMEDY, option=Option("threshold", 300.0))
    assert (error.problem, error.message) == ("above\n255", "threshold=300: above\n255")
    assert str(error) == "threshold=300: above 255 → give dark, or a lower first_step=4"
    assert error_line(error) == (
        "--threshold 300: above 255 → give --dark, or a lower --first-step 4"
    )
    assert error_line(InputError("no", hint="go")) == "no → go"


def test_remedies_are_values() -> None:
    for made in (copy.deepcopy(REMEDY), pickle.loads(pickle.dumps(REMEDY))):
        assert made == REMEDY
        assert hash(made) == hash(REMEDY)
