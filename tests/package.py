"""Packages of others, as pip would install them."""

from __future__ import annotations

from pathlib import Path

import pytest


def install_package(
    site: Path, name: str, source: str, entry: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Put a module on the path, with the entry points of its pyproject.toml (one table)."""
    info = site / f"{name}-1.0.dist-info"
    info.mkdir(parents=True)
    (site / f"{name}.py").write_text(source)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    header, *lines = entry.replace('"', "").splitlines()
    group = header.replace("project.entry-points.", "")
    (info / "entry_points.txt").write_text("\n".join([group, *lines]) + "\n")
    monkeypatch.syspath_prepend(str(site))
