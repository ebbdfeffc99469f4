"""Edits: every change a person can make, as values that JSON holds and `apply` does.

Settings are what the stripes are found with and the surface is made with; grid edits change what
was seen, before it becomes a surface; mesh edits change the surface; and measurements change
nothing. All lengths are mm in the object's frame, positions in pictures px.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, TypeAdapter, ValidationError

from turnscan.edit._measures import STRICT, Coordinate, Measure, Specify, Vector
from turnscan.edit._region import Length, Region
from turnscan.errors import FormatError
from turnscan.json_text import strict_json
from turnscan.stripes import Choice, Strategy
from turnscan.surface.holes import Bottom, FillHow, Hole, Top

Laser = Annotated[str, Field(min_length=1, max_length=200)]
Number = Annotated[int, Field(ge=0, le=100_000_000)]
"""Of a step or a line."""
Span = tuple[Number, Number]
"""First and last number, both included."""
Pixel = Annotated[float, Field(ge=-1, le=100_000_000)]
OptionName = Annotated[str, Field(min_length=1, max_length=80)]
OptionValue = bool | int | float | Annotated[str, Field(max_length=1000)] | None


@dataclass(frozen=True)
class HoleName:
    """A hole by its place, so that it can be found again on another surface."""

    __pydantic_config__ = STRICT
    centre: Vector
    size: Length
    """Largest distance between two points of its border."""

    @classmethod
    def of(cls, hole: Hole) -> HoleName:
        """The name of a hole of a mesh."""
        x, y, z = hole.centre.tolist()
        return cls((x, y, z), hole.size)


# Settings


@dataclass(frozen=True)
class ChangeSettings:
    """Make the surface with other settings; the last such edit that counts holds.

    It matters to the whole history, not to what follows it: the edits of grid and mesh, those made
    before it too, are done on the surface that these settings make.
    """

    __pydantic_config__ = STRICT
    options: Annotated[Mapping[OptionName, OptionValue], Field(max_length=200)] = field(hash=False)
    """Every option of a reconstruction, by name; which there are, and what they may be, is known
    to those who make surfaces with them."""
    name: OptionName = "default"
    """The set of settings that they were taken from."""
    kind: Literal["settings"] = "settings"


@dataclass(frozen=True)
class KeepSet:
    """Keep options as a named set of settings, in place of one of that name; no surface changes."""

    __pydantic_config__ = STRICT
    name: OptionName
    options: Annotated[Mapping[OptionName, OptionValue], Field(max_length=200)] = field(hash=False)
    """Every option of a reconstruction, by name."""
    kind: Literal["keep_set"] = "keep_set"


@dataclass(frozen=True)
class RenameSet:
    """Give a named set of settings another name."""

    __pydantic_config__ = STRICT
    name: OptionName
    to: OptionName
    kind: Literal["rename_set"] = "rename_set"


@dataclass(frozen=True)
class DeleteSet:
    """Delete a named set of settings."""

    __pydantic_config__ = STRICT
    name: OptionName
    kind: Literal["delete_set"] = "delete_set"


# Grid edits


@dataclass(frozen=True)
class DeletePoints:
    """Take points of one profile away."""

    __pydantic_config__ = STRICT
    laser: Laser
    step: Number
    lines: Annotated[tuple[Number, ...], Field(min_length=1, max_length=100_000)]
    kind: Literal["delete_points"] = "delete_points"


@dataclass(frozen=True)
class SetPoint:
    """Put the stripe of one line where a person saw it: a point moved, or added."""

    __pydantic_config__ = STRICT
    laser: Laser
    step: Number
    line: Number
    position: Pixel
    """px across the stripe (the column, for a vertical stripe)."""
    kind: Literal["set_point"] = "set_point"


@dataclass(frozen=True)
class PickCandidate:
    """Take another of the candidates of some lines: in each the one nearest to a position."""

    __pydantic_config__ = STRICT
    laser: Laser
    step: Number
    lines: Span
    position: Pixel
    """px: where the wanted candidate is in the first line; each line then follows the one before,
    so that a whole piece of a stripe is picked at once."""
    kind: Literal["pick_candidate"] = "pick_candidate"


@dataclass(frozen=True)
class ProfileOff:
    """Leave whole profiles out."""

    __pydantic_config__ = STRICT
    laser: Laser
    steps: Span
    kind: Literal["profile_off"] = "profile_off"


@dataclass(frozen=True)
class Redetect:
    """Seek the stripe again in a part of the grid; None keeps what the reconstruction uses."""

    __pydantic_config__ = STRICT
    laser: Laser
    steps: Span
    lines: Span
    threshold: Annotated[float, Field(gt=0, le=65535)] | None = None
    """Grey levels."""
    strategy: Strategy | None = None
    choose: Choice | None = None
    kind: Literal["redetect"] = "redetect"


@dataclass(frozen=True)
class CloseSeam:
    """Let the last profile of a turn neighbour the first, though their gap is a wide one."""

    __pydantic_config__ = STRICT
    laser: Laser
    kind: Literal["close_seam"] = "close_seam"


# Mesh edits


@dataclass(frozen=True)
class Delete:
    """Take faces away."""

    __pydantic_config__ = STRICT
    where: Region
    kind: Literal["delete"] = "delete"


@dataclass(frozen=True)
class Fill:
    """Fill holes: those named, or all, the ones larger than a limit left open."""

    __pydantic_config__ = STRICT
    holes: Annotated[tuple[HoleName, ...], Field(min_length=1, max_length=100_000)] | None = None
    """None fills all."""
    how: FillHow = "auto"
    largest: Length | None = None
    """Holes of a larger size stay open; None sets no limit."""
    kind: Literal["fill"] = "fill"


@dataclass(frozen=True)
class BridgeSides:
    """Join two sides of borders by a strip: the sides whose middles are nearest to two points."""

    __pydantic_config__ = STRICT
    a: Vector
    b: Vector
    kind: Literal["bridge_sides"] = "bridge_sides"


@dataclass(frozen=True)
class BridgeHoles:
    """Join two whole borders by a band, such as those of an island and of the hole round it."""

    __pydantic_config__ = STRICT
    a: HoleName
    b: HoleName
    how: FillHow = "tangent"
    kind: Literal["bridge_holes"] = "bridge_holes"


@dataclass(frozen=True)
class Close:
    """Close every gap: the foot down to the floor, the top, then all holes (`ClosingOptions`)."""

    __pydantic_config__ = STRICT
    floor: Coordinate | None = 0.0
    reach: Length = 5.0
    bottom: Bottom = "floor"
    top: Top | None = "plane"
    holes: FillHow | None = "auto"
    largest: Length | None = None
    kind: Literal["close"] = "close"


@dataclass(frozen=True)
class Cut:
    """Keep what lies on one side of a plane."""

    __pydantic_config__ = STRICT
    normal: Vector
    """Towards the side that is kept; of any length but 0."""
    distance: Coordinate
    """The plane is n·x = distance, n the unit normal."""
    cap: bool = True
    kind: Literal["cut"] = "cut"

    def __post_init__(self) -> None:
        if not any(self.normal):
            raise FormatError("cut.normal: a plane needs a direction")


@dataclass(frozen=True)
class Decimate:
    """Fewer faces: to a tolerance, to a number, or to both, whichever is reached first."""

    __pydantic_config__ = STRICT
    tolerance: Length | None = None
    """mm that no place of the surface may move."""
    faces: Annotated[int, Field(ge=4, le=100_000_000)] | None = None
    kind: Literal["decimate"] = "decimate"

    def __post_init__(self) -> None:
        if self.tolerance is None and self.faces is None:
            raise FormatError("decimate: give a tolerance or a face count")


@dataclass(frozen=True)
class Smooth:
    """Smooth a region, its border half as much as its inside; nothing else moves."""

    __pydantic_config__ = STRICT
    where: Region
    rounds: Annotated[int, Field(ge=1, le=1000)] = 5
    strength: Annotated[float, Field(gt=0, le=1)] = 1.0
    kind: Literal["smooth"] = "smooth"


@dataclass(frozen=True)
class Despike:
    """Take single vertices that stick out of the surface away, and fill where they were."""

    __pydantic_config__ = STRICT
    where: Region | None = None
    """None looks everywhere."""
    beyond: Annotated[float, Field(gt=0, le=1000)] = 6.0
    """Times the usual roughness."""
    how: FillHow = "auto"
    kind: Literal["despike"] = "despike"


@dataclass(frozen=True)
class RemovePieces:
    """Remove loose pieces of the surface that have fewer faces than a number."""

    __pydantic_config__ = STRICT
    fewer: Annotated[int, Field(ge=2, le=100_000_000)]
    kind: Literal["remove_pieces"] = "remove_pieces"


GridEdit = DeletePoints | SetPoint | PickCandidate | ProfileOff | Redetect | CloseSeam
MeshEdit = (
    Delete
    | Fill
    | BridgeSides
    | BridgeHoles
    | Close
    | Cut
    | Decimate
    | Smooth
    | Despike
    | RemovePieces
)
SetEdit = KeepSet | RenameSet | DeleteSet
Edit = ChangeSettings | SetEdit | GridEdit | MeshEdit | Measure | Specify

_ADAPTER: TypeAdapter[Edit] = TypeAdapter(Annotated[Edit, Field(discriminator="kind")])
_TYPED = {
    "string_too_short": "may not be empty",
    "string_too_long": "has more than {max_length} characters",
    "string_unicode": "has half a character",
}
"""What a person can do wrong in a field of an edit, by pydantic's word for it."""
_HINT = "docs/reference/edits.md lists the edits and their keys"
_LIKE = f'give an edit like {{"kind": "decimate", "faces": 20000}}; {_HINT}'


def needs_rebuild(edit: Edit) -> bool:
    """Whether the edit changes what the surface is made from, so that it must be rebuilt."""
    return isinstance(edit, GridEdit | ChangeSettings)


def is_measure(edit: Edit) -> bool:
    """Whether the edit is a measurement, which leaves the surface as it is."""
    return isinstance(edit, get_args(Measure))


def is_written(edit: Edit) -> bool:
    """Whether the edit is a note in the history, of a set of settings or a dimension.

    It leaves the surface as it is, and finds nothing out about it.
    """
    return isinstance(edit, SetEdit | Specify)


def edit_to_value(edit: Edit) -> dict[str, Any]:
    """An edit as plain values for JSON."""
    return asdict(edit)


def edit_from_value(value: Mapping[str, Any], source: str = "edit") -> Edit:
    """An edit from plain values, as JSON gives them; a `Region` may stand for its own values.

    Raises FormatError naming ``source`` and the key.
    """
    try:
        return _ADAPTER.validate_python(dict(value))
    except ValidationError as e:
        raise bad_key(e, source) from None


def edit_from_json(text: str, source: str = "edit") -> Edit:
    """An edit from JSON text. Raises FormatError naming the key, LimitExceeded."""
    try:
        body = strict_json(text, source)
    except FormatError as e:
        raise FormatError(e.message, hint=_LIKE) from None
    if not isinstance(body, dict):
        raise FormatError(f"{source}: not an object", hint=_LIKE)
    return edit_from_value(body, source)


def bad_key(e: ValidationError, source: str) -> FormatError:
    """The first thing that pydantic does not like, as one line."""
    first = e.errors(include_url=False)[0]
    key = ".".join(str(p) for p in first["loc"]) or "edit"
    if first["type"] in _TYPED:
        typed = _TYPED[first["type"]].format(**first.get("ctx", {}))
        return FormatError(f"{source}: {key} {typed}", hint="correct it, then repeat")
    value = repr(first.get("input"))
    shown = value if len(value) <= 60 else value[:57] + "…"
    said = "unknown kind" if first["type"] == "union_tag_invalid" else first["msg"]
    return FormatError(f"{source}: {key}: {said} (found {shown})", hint=_HINT)
