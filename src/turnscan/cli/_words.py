"""Errors and findings in the words of the command line: an option is a flag."""

from __future__ import annotations

from dataclasses import replace

from turnscan.errors import TurnscanError
from turnscan.findings import Finding
from turnscan.remedy import Option, Remedy

_FLAGS = {
    "datums": "--datum",
    "dxf_forms": "--dxf-form",
    "exposures": "--exposure",
    "lamps": "--lamp",
    "limits": "--limit",
    "tolerances": "--tolerance",
}
"""Flags whose names are not those of the options: most may be given several times."""


def flag_of(name: str) -> str:
    """The flag of an option."""
    return _FLAGS.get(name) or "--" + name.replace("_", "-")


def error_line(error: TurnscanError) -> str:
    """An error as one line: what is wrong, and what to do."""
    text = error.message if error.option is None else f"{_flag(error.option)}: {error.problem}"
    if error.hint:
        text += f" → {_worded(error.hint)}"
    return " ".join(text.split())


def with_flags(finding: Finding) -> Finding:
    """A finding whose remedy names flags."""
    return replace(finding, remedy=_worded(finding.remedy))


def _worded(remedy: str | Remedy) -> str:
    return remedy if isinstance(remedy, str) else remedy.worded(_flag)


def _flag(option: Option) -> str:
    flag = flag_of(option.name)
    return flag if option.value is None else f"{flag} {option.value_text}"
