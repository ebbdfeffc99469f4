"""Option classes in the words of JSON Schema (draft 2020-12), for forms."""

from __future__ import annotations

from typing import Any

from turnscan.workflows._declare import Checked, Declared, declared

_TYPES = {
    "choice": "string",
    "number": "number",
    "count": "integer",
    "switch": "boolean",
    "text": "string",
}


def option_schemas(kind: type[Checked]) -> dict[str, dict[str, Any]]:
    """A schema for the value of each option, by its name, with its default and what it does."""
    return {name: _schema(option) for name, option in declared(kind).items()}


def _schema(option: Declared) -> dict[str, Any]:
    one: dict[str, Any] = {"type": _TYPES[option.kind]}
    if option.kind == "choice":
        one["enum"] = [*option.choices, *(option.more() if option.more is not None else ())]
    if option.least is not None:
        one["exclusiveMinimum" if option.above else "minimum"] = option.least
    if option.most is not None:
        one["maximum"] = option.most
    if option.optional:
        one["type"] = [one["type"], "null"]
        if "enum" in one:
            one["enum"].append(None)
    return {**one, "default": option.default, "description": option.help}
