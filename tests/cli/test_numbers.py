"""NaN and infinity stop at the door, at every option that takes a number."""

from __future__ import annotations

import click
import pytest
from click.testing import CliRunner

from turnscan.cli import turnscan
from turnscan.cli._numbers import Finite

CONTEXT = click.Context(turnscan)
NUMBERS = [
    (verb, option.opts[0])
    for verb in turnscan.list_commands(CONTEXT)
    for option in turnscan.get_command(CONTEXT, verb).params
    if isinstance(option.type, click.types.FloatParamType)
]


def test_there_are_some() -> None:
    assert ("reconstruct", "--radius") in NUMBERS
    assert len(NUMBERS) > 20


@pytest.mark.parametrize(("verb", "option"), NUMBERS)
def test_only_finite_numbers(verb: str, option: str) -> None:
    command = turnscan.get_command(CONTEXT, verb)
    (chosen,) = (o for o in command.params if option in o.opts)
    assert isinstance(chosen.type, Finite)
    for text in ("nan", "inf", "-inf", "1e999"):
        with pytest.raises(click.UsageError):
            chosen.type.convert(text, chosen, CONTEXT)


def test_the_verb_says_so_and_the_help_names_limits() -> None:
    done = CliRunner().invoke(turnscan, ["measure", "a.ply", "--tolerance", "nan"])
    assert done.exit_code == 2
    assert "'nan' is not a finite number" in done.output
    words = CliRunner().invoke(turnscan, ["reconstruct", "--help"]).output
    assert "[x>0]" in words
    assert "None" not in words
