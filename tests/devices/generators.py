"""Function generators of PyVISA-sim: a good one, and one of each kind that must be refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

IDN = "ACME,Two-Channel Function Generator,4711,1.02"
ENDS = {"USB INSTR": {"q": "\n", "r": "\n"}}
Definition = dict[str, Any]


def number(header: str, low: float, high: float, at: float) -> Definition:
    return {
        "default": str(at),
        "getter": {"q": f"{header}?", "r": "{:+.9E}"},
        "setter": {"q": header + " {:s}"},
        "specs": {"min": str(low), "max": str(high), "type": "float"},
    }


def word(header: str, words: list[str], at: str) -> Definition:
    return {
        "default": at,
        "getter": {"q": f"{header}?", "r": "{:s}"},
        "setter": {"q": header + " {:s}"},
        "specs": {"valid": words, "type": "str"},
    }


def fixed(header: str, at: str) -> Definition:
    """It says so whatever it is told."""
    return {"default": at, "getter": {"q": f"{header}?", "r": "{:s}"}}


def device(idn: str | None = IDN, error: str = '0,"No error"', **changed: Definition) -> Definition:
    dialogues = [{"q": "*CLS"}, {"q": "SYST:ERR?", "r": error}]
    if idn is not None:
        dialogues.append({"q": "*IDN?", "r": idn})
    properties = {
        "shape": word("SOUR1:FUNC", ["SIN", "TRI", "SQU"], "SQU"),
        "frequency": number("SOUR1:FREQ", 1e-3, 2e7, 1000.0),
        "volts": number("SOUR1:VOLT", 1e-3, 10.0, 0.1),
        "offset": number("SOUR1:VOLT:OFFS", -5.0, 5.0, 0.0),
        "mirror": word("OUTP1", ["ON", "OFF"], "OFF"),
        "gate_shape": word("SOUR2:FUNC", ["SIN", "DC"], "SIN"),
        "gate_volts": number("SOUR2:VOLT:OFFS", -5.0, 5.0, 0.0),
        "gate": word("OUTP2", ["ON", "OFF"], "OFF"),
    }
    return {"eom": ENDS, "error": {}, "dialogues": dialogues, "properties": properties | changed}


KINDS = {
    "good": device(),
    "complains": device(error='-222,"Data out of range"'),
    "slow": device(frequency=number("SOUR1:FREQ", 1e-3, 100.0, 50.0)),
    "clips": device(volts=fixed("SOUR1:VOLT", "1.5")),
    "babbles": device(volts=fixed("SOUR1:VOLT", "lots")),
    "square": device(shape=fixed("SOUR1:FUNC", "SQU")),
    "silent": {"eom": ENDS, "error": {}},
    "dumb": device(idn=None),
    "multimeter": device(idn="ACME,Multimeter,0815,3.1"),
    "nameless": device(idn="hello"),
    "open gate": device(gate=fixed("OUTP2", "ON")),
    "lame mirror": device(mirror=fixed("OUTP1", "OFF")),
}


def resource(kind: str) -> str:
    return f"USB0::0x0957::0x2807::{kind.replace(' ', '-')}::INSTR"


def definitions(path: Path) -> str:
    """Write them all to a file; what PyVISA calls its library."""
    made = {
        "spec": "1.0",
        "devices": KINDS,
        "resources": {resource(kind): {"device": kind} for kind in KINDS},
    }
    path.write_text(json.dumps(made))  # JSON is YAML, too
    return f"{path}@sim"
