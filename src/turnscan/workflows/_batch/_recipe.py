"""Recipe of a batch: what becomes of every scan of it, read from a TOML file.

A recipe has the tables ``reconstruct`` (options of that verb), ``output``, ``compare`` and
``pictures`` (options of an import); docs/how-to/batch.md shows one that can be filled in.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeVar

from turnscan.errors import FormatError, InputError
from turnscan.workflows._files._kept_options import DEFAULT_SET, check_name
from turnscan.workflows._options._declare import Checked, chosen
from turnscan.workflows._options._import import (
    AngleSource,
    ImportOptions,
    ListedAngles,
    parse_angles,
)
from turnscan.workflows._options._reconstruct import ReconstructOptions
from turnscan.workflows._options._units import UNITS, check_suffixes

Options = TypeVar("Options", bound=Checked)

_HINT = "docs/how-to/batch.md shows a recipe that can be filled in"
_TABLES: Mapping[str, tuple[str, ...]] = {
    "output": ("formats", "report"),
    "compare": ("reference", "unit", "within_mm"),
    "pictures": ("rig", "angles"),
}
"""Keys of the tables that are no options of a verb."""


@dataclass(frozen=True)
class Reference:
    """What each surface is compared with."""

    path: Path
    """A mesh file, or a scan."""
    unit: str = "mm"
    """Of a mesh file."""
    within: float | None = None
    """mm: 95 % of the measured vertices must lie as near to it for a pass; None: nothing must."""


@dataclass(frozen=True)
class Pictures:
    """How a folder of pictures becomes a scan."""

    rig: Path
    angles: AngleSource
    options: ImportOptions = field(default_factory=ImportOptions)


@dataclass(frozen=True)
class Recipe:
    """What becomes of every scan of a batch."""

    options: ReconstructOptions | None = None
    """None: each scan's own, those of its set ``settings``."""
    settings: str = DEFAULT_SET
    edits: Literal["own", "none"] | Path = "own"
    """Repairs to do: each scan's own, none, or those of this file on every scan."""
    formats: tuple[str, ...] = ("stl",)
    """Suffixes of the files to write, without the dot."""
    report: bool = True
    """Whether each scan has a report (HTML) of its own."""
    reference: Reference | None = None
    pictures: Pictures | None = None
    """None: folders of pictures are refused."""

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that it names, whose content matters as much as its own."""
        named = [self.edits] if isinstance(self.edits, Path) else []
        named += [] if self.reference is None else [self.reference.path]
        if self.pictures is not None:
            named.append(self.pictures.rig)
            if isinstance(self.pictures.angles, ListedAngles):
                named.append(self.pictures.angles.path)
        return tuple(named)


def read_recipe(path: Path) -> Recipe:
    """Read a recipe; names of files in it are relative to its folder.

    Raises FormatError naming the key, InputError where a file that it names is missing.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as e:
        raise InputError(f"{path}: {e.strerror or e}", hint=_HINT) from None
    except UnicodeDecodeError:
        raise FormatError(f"{path}: not a text file", hint=_HINT) from None
    recipe = recipe_from_text(text, path.parent, str(path))
    for named in recipe.files:
        if not named.is_file():
            raise InputError(f"{path}: there is no file {named}", hint="correct the name")
    return recipe


def recipe_from_text(text: str, folder: Path, where: str) -> Recipe:
    """A recipe from TOML; ``folder`` is where files that it names lie. Raises FormatError."""
    try:
        body = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as e:
        raise FormatError(f"{where}: not TOML ({e})", hint=_HINT) from None
    return _Reader(body, folder, where).recipe()


@dataclass
class _Reader:
    body: dict[str, Any]
    folder: Path
    where: str

    def recipe(self) -> Recipe:
        self._only("the recipe", self.body, ("reconstruct", *_TABLES, "settings", "edits"))
        output = self._table("output")
        self._only("output", output, _TABLES["output"])
        edits = self._text("edits", self.body.get("edits", "own"))
        settings = self._text("settings", self.body.get("settings", DEFAULT_SET))
        try:
            check_name(settings)
        except InputError as e:
            raise FormatError(f"{self.where}: settings: {e.problem}", hint=e.hint) from None
        wanted = self._table("reconstruct")
        if wanted and "settings" in self.body:
            raise self._wrong("gives both reconstruct and settings", "keep one of the two")
        report = output.get("report", True)
        if not isinstance(report, bool):
            raise self._wrong(f"output.report {report!r} is not true or false")
        return Recipe(
            self._options("reconstruct", ReconstructOptions, wanted) if wanted else None,
            settings,
            "own" if edits == "own" else "none" if edits == "none" else self._path(edits),
            self._formats(output.get("formats", ["stl"])),
            report,
            self._reference(),
            self._pictures(),
        )

    def _reference(self) -> Reference | None:
        table = self._table("compare")
        if not table:
            return None
        self._only("compare", table, _TABLES["compare"])
        if "reference" not in table:
            raise self._wrong("compare has no reference")
        unit = table.get("unit", "mm")
        if unit not in UNITS:
            raise self._wrong(f"compare.unit {unit!r} is not one of {', '.join(UNITS)}")
        within = table.get("within_mm")
        number = isinstance(within, int | float) and not isinstance(within, bool)
        if within is not None and not (number and math.isfinite(within) and within > 0):
            raise self._wrong(f"compare.within_mm {within!r} is not a length above 0")
        path = self._path(self._text("compare.reference", table["reference"]))
        return Reference(path, unit, within)

    def _pictures(self) -> Pictures | None:
        table = self._table("pictures")
        if not table:
            return None
        own = _TABLES["pictures"]
        for key in own:
            if key not in table:
                raise self._wrong(f"pictures has no {key}")
        try:
            angles = parse_angles(self._text("pictures.angles", table["angles"]))
        except InputError as e:
            raise self._wrong(f"pictures.angles: {e.problem}", str(e.hint)) from None
        if isinstance(angles, ListedAngles):
            angles = ListedAngles(self._path(str(angles.path)))
        options = {key: value for key, value in table.items() if key not in own}
        rig = self._path(self._text("pictures.rig", table["rig"]))
        return Pictures(rig, angles, self._options("pictures", ImportOptions, options))

    def _formats(self, given: object) -> tuple[str, ...]:
        if not isinstance(given, list) or not all(isinstance(one, str) for one in given):
            raise self._wrong(f'output.formats {given!r} is not a list like ["dxf", "stl"]')
        names = tuple(dict.fromkeys(one.lower().removeprefix(".") for one in given))
        for name in names:
            try:
                check_suffixes([Path(f"part.{name}")])
            except InputError as e:
                raise self._wrong(f"output.formats: {e.problem}", str(e.hint)) from None
        return names

    def _options(self, name: str, kind: type[Options], table: dict[str, Any]) -> Options:
        try:
            return chosen(kind, None, table)
        except InputError as e:
            at = "" if e.option is None else f".{e.option.name}"
            raise FormatError(f"{self.where}: {name}{at}: {e.problem}", hint=e.hint) from None

    def _table(self, name: str) -> dict[str, Any]:
        table = self.body.get(name, {})
        if not isinstance(table, dict):
            raise self._wrong(f"{name} is not a table")
        return table

    def _text(self, name: str, value: object) -> str:
        if not isinstance(value, str) or not value:
            raise self._wrong(f"{name} {value!r} is not a text")
        return value

    def _path(self, text: str) -> Path:
        return (self.folder / text).resolve()

    def _only(self, name: str, table: Mapping[str, object], known: tuple[str, ...]) -> None:
        for key in table:
            if key not in known:
                raise self._wrong(f"{name} has no key {key!r}", f"there is {', '.join(known)}")

    def _wrong(self, problem: str, hint: str = _HINT) -> FormatError:
        return FormatError(f"{self.where}: {problem}", hint=hint)
