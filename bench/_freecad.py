"""What FreeCAD makes of a STEP file, where it is installed: a second program that reads them."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

_COMMANDS = ("freecadcmd", "FreeCADCmd")
_PATIENCE = 600.0
"""s."""
_DEFLECTION = 0.02
"""mm: of the facets that its faces become for the second volume."""
_SCRIPT = """
import json, os
import FreeCAD, Mesh, Part
shape = Part.Shape()
shape.read(os.environ["STEP_FILE"])
facets = Mesh.Mesh(shape.tessellate(float(os.environ["DEFLECTION"])))
told = {
    "version": ".".join(FreeCAD.Version()[:3]),
    "solids": len(shape.Solids),
    "faces": len(shape.Faces),
    "valid": shape.isValid(),
    "volume": shape.Volume if shape.Solids else None,
    "facets": facets.Volume if shape.Solids else None,
}
with open(os.environ["ANSWER"], "w") as answer:
    json.dump(told, answer)
"""


@dataclass(frozen=True)
class Reading:
    """A STEP file as FreeCAD reads it."""

    version: str
    solids: int
    faces: int
    valid: bool
    volume: float | None
    """mm³ by its own integral, which has no bound for its error; None without a solid."""
    facets: float | None
    """mm³ within facets of its faces."""

    def __str__(self) -> str:
        held = f"{self.solids} solids, {self.faces} faces, {'valid' if self.valid else 'not valid'}"
        if self.volume is None or self.facets is None:
            return held
        return f"{held}, {self.volume:.0f} mm³ by its integral, {self.facets:.0f} mm³ by its facets"


def read_by_freecad(step: bytes) -> Reading | None:
    """What it says of a file; None where it is not installed, or says nothing."""
    command = next(filter(None, map(shutil.which, _COMMANDS)), None)
    if command is None:
        return None
    with tempfile.TemporaryDirectory() as scratch:
        part, script, answer = (Path(scratch) / n for n in ("part.step", "read.py", "answer.json"))
        part.write_bytes(step)
        script.write_text(_SCRIPT)
        told = {"STEP_FILE": part, "DEFLECTION": _DEFLECTION, "ANSWER": answer, "HOME": scratch}
        plain = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
        subprocess.run(
            [command, str(script)],
            env=plain | {k: str(v) for k, v in told.items()},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=_PATIENCE,
            check=False,
        )
        return Reading(**json.loads(answer.read_text())) if answer.exists() else None
