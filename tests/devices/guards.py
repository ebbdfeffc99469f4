"""Guards with a defect, for tests that must then fail."""

from __future__ import annotations

from pathlib import Path

from turnscan.devices._guard_client import GUARD_SCRIPT

MODULES = ("_run_guard.py", "_guard.py", "_dialects.py", "_visa.py")


def mutated(folder: Path, old: str, new: str) -> Path:
    """The guard's program in this folder, with the one passage replaced; its script."""
    whole = {name: (GUARD_SCRIPT.parent / name).read_text() for name in MODULES}
    count = sum(source.count(old) for source in whole.values())
    assert count == 1, f"{count} places for {old!r}"
    for name, source in whole.items():
        (folder / name).write_text(source.replace(old, new))
    return folder / GUARD_SCRIPT.name
