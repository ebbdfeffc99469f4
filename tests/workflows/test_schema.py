"""Schemas of the verbs say what the flags of the command line say: both are made of the options."""

from __future__ import annotations

import importlib
import json
from typing import Any

import click
import pytest

from turnscan.cli._words import flag_of
from turnscan.errors import InputError
from turnscan.workflows import VERBS, Verb
from turnscan.workflows._options._declare import Checked, Declared

COMMANDS = {"range-scans": "reconstruct"}
"""Verbs whose command has another name."""
ONLY_COMMAND_LINE = {
    # `figures` is what the command line prints as JSON.
    "import": {"lit"},  # several series
    "range-scans": {
        "rig_path", "base", "name", "edits", "strategy", "choose", "refine", "threshold", "spacing",
        "spacing_by", "spacing_between", "every", "radius", "z_min", "z_max", "top", "bottom",
        "denoise", "outliers", "largest_sigma",
    },
    "calibrate": {"as_json"},
    "join": {"base"},
    "verify": {"history", "trend", "date"},
}  # fmt: skip
"""Parameters of commands that range scans, or a browser without their files, do not have."""
SAID = {"json": "figures", "as_json": "figures", "points_path": "points", "rig_path": "rig",
        "reports": "report"}  # fmt: skip


def _command(verb: Verb) -> click.Command:
    name = COMMANDS.get(verb.name, verb.name)
    found: click.Command = importlib.import_module(f"turnscan.cli._{name}").verb
    return found


def _cases() -> list[Any]:
    return [
        pytest.param(verb, option, id=f"{verb.name}-{name}")
        for verb in VERBS.values()
        for name, option in verb.declared
    ]


@pytest.mark.parametrize(("verb", "option"), _cases())
def test_an_option_is_the_flag_of_the_command_line(verb: Verb, option: Declared) -> None:
    schema = verb.json_schema()["properties"][option.name]
    flag = next(p for p in _command(verb).params if flag_of(option.name) in p.opts)
    assert isinstance(flag, click.Option)
    assert schema["role"] == "option"
    assert schema["description"] == flag.help
    assert (schema["type"] == "array") == flag.multiple
    one = schema["items"] if flag.multiple else schema
    if option.required:
        assert flag.required
        assert "default" not in schema
        assert option.name in verb.json_schema()["required"]
    else:
        default = False if option.kind == "switch" else flag.default
        assert flag.is_flag == (option.kind == "switch")
        assert schema["default"] == (list(default or ()) if flag.multiple else default)
    if isinstance(flag.type, click.Choice):
        assert [c for c in one["enum"] if c is not None] == list(flag.type.choices)
    else:
        assert "enum" not in one
    low, high = getattr(flag.type, "min", None), getattr(flag.type, "max", None)
    strict = getattr(flag.type, "min_open", False)
    assert one.get("exclusiveMinimum" if strict else "minimum") == low
    assert one.get("maximum") == high
    kinds = {click.STRING: "string", click.INT: "integer", click.BOOL: "boolean"}
    if flag.type in kinds:
        assert kinds[flag.type] in one["type"]


@pytest.mark.parametrize("verb", VERBS.values(), ids=list(VERBS))
def test_everything_that_the_command_takes_is_in_the_schema(verb: Verb) -> None:
    properties = verb.json_schema()["properties"]
    own = ONLY_COMMAND_LINE.get(verb.name, set())
    taken = set()
    for parameter in _command(verb).params:
        name = str(parameter.name)
        known = {name, SAID.get(name, name), name.removesuffix("_path")}
        assert known & (set(properties) | own), f"{name} of {verb.name} is not in its schema"
        taken |= known
    assert set(properties) <= taken


@pytest.mark.parametrize("verb", VERBS.values(), ids=list(VERBS))
def test_a_schema_is_plain_json_and_its_defaults_are_good(verb: Verb) -> None:
    schema = verb.json_schema()
    assert json.loads(json.dumps(schema, allow_nan=False)) == schema
    assert {p["role"] for p in schema["properties"].values()} <= {"option", "input", "output"}
    assert all(p["description"] for p in schema["properties"].values())
    assert set(schema["required"]) <= set(schema["properties"])
    for part in verb.options:
        if not any(o.required for o in part.declared.values()):
            assert isinstance(part.kind(), Checked)


def test_a_value_that_the_schema_excludes_is_refused_by_name() -> None:
    for verb in VERBS.values():
        for part in verb.options:
            for name, option in part.declared.items():
                if option.least is None:
                    continue
                low = option.least if option.above else option.least - 1
                bad = (low,) if option.many else low
                with pytest.raises(InputError) as caught:
                    part.kind(**{name: bad})
                assert caught.value.option is not None
                assert caught.value.option.name == name
