"""Grids, and the headers of binary GETs."""

from __future__ import annotations

from typing import Literal

from turnscan.app._protocol._base import Count, Model, Opaque


class GridEntry(Model):
    """One grid: a laser, and a run of steps of it (a whole turn of the table, where there are
    several). The profile of a vertex is in the grid of its laser that holds its step."""

    grid: Count
    laser: str
    first_step: Count
    last_step: Count


class MeshHeader(Model):
    """Of ``mesh``."""

    scan: Opaque
    revision: Count
    epoch: Count
    lasers: list[str]
    """What the numbers in the array laser stand for."""
    unit: Literal["mm"] = "mm"


class FileMeshHeader(Model):
    """Of ``/api/files/{file}/mesh``; its own colours are the array colour u8 (v, 3)."""

    lasers: list[str]
    """What the numbers in the array laser stand for."""
    unit: Literal["mm"] = "mm"


class GridHeader(Model):
    """Of ``grid``."""

    scan: Opaque
    revision: Count
    grid: Count
    laser: str
    closed: bool
    orientation: Literal["vertical", "horizontal"]
    causes: list[str]
    """Words for people; 0 is there: nothing is missing."""


class ProfileHeader(Model):
    """Of ``profile``."""

    scan: Opaque
    revision: Count
    grid: Count
    laser: str
    step: Count
    angle_deg: float
    orientation: Literal["vertical", "horizontal"]
    width: Count
    height: Count
    threshold: float
    strategy: str
    edited: bool
