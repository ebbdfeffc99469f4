"""History: the edits of a scan, in order, with undo and redo; Action: one entry of its log.

The scan file keeps the log, to which actions are only ever appended. The history is what they
come to, so that a crash can lose the last action and no other, and nothing is ever forgotten.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from turnscan.edit._edits import (
    ChangeSettings,
    Edit,
    bad_key,
    edit_from_value,
    edit_to_value,
)
from turnscan.errors import FormatError, InputError, ScanNewer
from turnscan.json_text import strict_json

VERSION = 3
"""Of the log; what older programs can read is written as version 1."""
_MOST_BRANCHES = 200
_MOST = 100_000
_STRICT = ConfigDict(extra="forbid")
Id = Annotated[int, Field(ge=1, le=1 << 53, strict=True)]


@dataclass(frozen=True)
class Add:
    """An edit was made; what had been undone leaves the history and is kept as a branch."""

    __pydantic_config__ = _STRICT
    id: Id
    edit: Annotated[Edit, Field(discriminator="kind")]
    do: Literal["add"] = "add"


@dataclass(frozen=True)
class Go:
    """Undo, redo, or a step through the history: the first ``cursor`` edits count now."""

    __pydantic_config__ = _STRICT
    cursor: Annotated[int, Field(ge=0, le=_MOST, strict=True)]
    do: Literal["go"] = "go"


@dataclass(frozen=True)
class Switch:
    """One edit was switched off, or on again."""

    __pydantic_config__ = _STRICT
    id: Id
    on: Annotated[bool, Field(strict=True)]
    do: Literal["switch"] = "switch"


@dataclass(frozen=True)
class Branch:
    """The branch whose last edit this is became the history; what was the history is a branch."""

    __pydantic_config__ = _STRICT
    id: Id
    do: Literal["branch"] = "branch"


Action = Add | Branch | Go | Switch
_ACTION: TypeAdapter[Action] = TypeAdapter(Annotated[Action, Field(discriminator="do")])


@dataclass(frozen=True)
class Entry:
    """One edit in the history."""

    id: int
    """Its number for ever; those of discarded edits are not used again."""
    edit: Edit
    on: bool = True
    """False for one that was switched off."""

    @property
    def place(self) -> str:
        """How findings name it."""
        return f"edit {self.id} ({self.edit.kind})"


@dataclass(frozen=True)
class History:
    """Edits in the order they were made, and how many of them count."""

    entries: tuple[Entry, ...] = ()
    cursor: int = 0
    """The first so many are done; those after it are undone and can be redone."""
    next_id: int = 1
    branches: tuple[tuple[Entry, ...], ...] = ()
    """Other histories, from their first edit on, the newest last: each was left by an edit that was
    made after stepping back. At most 200; the log itself keeps all."""

    @property
    def enabled(self) -> tuple[Entry, ...]:
        """What is to be applied: done, and not switched off."""
        return tuple(e for e in self.entries[: self.cursor] if e.on)

    def add(self, edit: Edit) -> Add:
        """The action that makes an edit. Raises InputError for one too many."""
        if self.cursor >= _MOST:
            raise InputError(
                f"the history has {_MOST} edits, as many as it may", hint="undo one first"
            )
        return Add(self.next_id, edit)

    def undo(self) -> Go:
        """The action that takes back the last edit that counts. Raises InputError for none."""
        done = [i for i, e in enumerate(self.entries[: self.cursor]) if e.on]
        if not done:
            raise InputError("there is nothing to undo")
        return Go(done[-1])

    def redo(self) -> Go:
        """The action that does the next undone edit again. Raises InputError for none."""
        ahead = [i for i, e in enumerate(self.entries) if i >= self.cursor and e.on]
        if not ahead:
            raise InputError("there is nothing to redo")
        return Go(ahead[0] + 1)

    def branch(self, id: int) -> Branch:
        """The action that takes up the branch that ends with this edit. Raises InputError."""
        if all(path[-1].id != id for path in self.branches):
            raise InputError(f"no branch of the history ends with edit {id}")
        return Branch(id)

    def switch(self, id: int, on: bool) -> Switch:
        """The action that switches one edit on or off. Raises InputError where there is none."""
        if all(e.id != id for e in self.entries):
            raise _unknown(id)
        return Switch(id, on)

    def after(self, action: Action) -> History:
        """The history after an action. Raises InputError for one that does not fit it."""
        match action:
            case Add():
                if action.id < self.next_id:
                    raise InputError(f"edit {action.id} is in the history already")
                kept = (*self.entries[: self.cursor], Entry(action.id, action.edit))
                return History(kept, len(kept), action.id + 1, self._with_branch(kept))
            case Branch():
                path = next((p for p in self.branches if p[-1].id == action.id), None)
                if path is None:
                    raise InputError(f"no branch of the history ends with edit {action.id}")
                return replace(
                    self, entries=path, cursor=len(path), branches=self._with_branch(path)
                )
            case Go():
                if action.cursor > len(self.entries):
                    raise InputError(
                        f"there are {len(self.entries)} edits, so none after {action.cursor}"
                    )
                return replace(self, cursor=action.cursor)
            case Switch():
                at = next((i for i, e in enumerate(self.entries) if e.id == action.id), None)
                if at is None:
                    raise _unknown(action.id)
                entry = replace(self.entries[at], on=action.on)
                return replace(self, entries=(*self.entries[:at], entry, *self.entries[at + 1 :]))

    def _with_branch(self, now: tuple[Entry, ...]) -> tuple[tuple[Entry, ...], ...]:
        """The branches when ``now`` is the history: what it leaves out of this one is kept."""
        ids = {e.id for e in now}
        others = tuple(path for path in self.branches if path[-1].id not in ids)
        lost = bool(self.entries) and self.entries[-1].id not in ids
        return (*others, self.entries)[-_MOST_BRANCHES:] if lost else others


def settings_in(entries: Iterable[Entry]) -> tuple[Entry, ChangeSettings] | None:
    """The settings that hold after these edits, and where they stand; None where none sets any."""
    found = [(e, e.edit) for e in entries if isinstance(e.edit, ChangeSettings) and e.on]
    return found[-1] if found else None


def _unknown(id: int) -> InputError:
    return InputError(f"there is no edit {id} in the history", hint="list them with turnscan edits")


def action_to_json(action: Action) -> str:
    """An action as the text that the log keeps."""
    version = 2 if isinstance(action, Branch) else 1
    if isinstance(action, Add) and isinstance(action.edit, ChangeSettings):
        version = 3
    body: dict[str, Any] = {"version": version, **asdict(action)}
    return _dump(body)


def action_from_json(text: str, source: str = "edits") -> Action:
    """An action of the log. Raises FormatError naming the key, ScanNewer, LimitExceeded."""
    body = _versioned(strict_json(text, source), source)
    try:
        return _ACTION.validate_python(body)
    except ValidationError as e:
        raise bad_key(e, source) from None


def history_from_log(texts: Iterable[str], source: str = "edits") -> History:
    """What the actions of a log, in their order, come to.

    Raises FormatError naming the entry of the log and the key, ScanNewer, LimitExceeded.
    """
    history = History()
    for number, text in enumerate(texts, start=1):
        where = f"{source}: entry {number} of the log"
        try:
            history = history.after(action_from_json(text, where))
        except FormatError:
            raise
        except InputError as e:
            raise FormatError(f"{where}: {e.message}") from None
    return history


def history_to_json(history: History) -> str:
    """The edits that are done, as a file to be kept, read and replayed elsewhere."""
    settings = any(isinstance(e.edit, ChangeSettings) for e in history.entries[: history.cursor])
    return _dump(
        {
            "format": "turnscan-edits",
            "version": 2 if settings else 1,
            "edits": [
                {"id": e.id, "on": e.on, "edit": edit_to_value(e.edit)}
                for e in history.entries[: history.cursor]
            ],
        }
    )


def history_from_json(text: str, source: str = "edits") -> History:
    """A file that `history_to_json` wrote. Raises FormatError naming the key, ScanNewer."""
    body = strict_json(text, source)
    if not isinstance(body, dict) or body.get("format") != "turnscan-edits":
        raise FormatError(
            f"{source}: format: not an edits file",
            hint="make one with turnscan edits SCAN -o FILE.json",
        )
    body = _versioned(body, source, 2)
    edits = body.get("edits")
    if set(body) != {"format", "edits"} or not isinstance(edits, list) or len(edits) > _MOST:
        raise FormatError(f"{source}: edits: not a list of at most {_MOST} edits")
    history = History()
    for i, item in enumerate(edits):
        where = f"{source}: edits.{i}"
        if not isinstance(item, dict) or set(item) != {"id", "on", "edit"}:
            raise FormatError(f"{where}: not an object of id, on and edit")
        if type(item["id"]) is not int or type(item["on"]) is not bool:
            raise FormatError(f"{where}: id is not a whole number, or on not true or false")
        if not isinstance(item["edit"], dict):
            raise FormatError(f"{where}.edit: not an object")
        try:
            history = history.after(Add(item["id"], edit_from_value(item["edit"], where)))
        except FormatError:
            raise
        except InputError as e:
            raise FormatError(f"{where}.id: {e.message}") from None
        history = history.after(Switch(item["id"], item["on"]))
    return history


def _versioned(body: Any, source: str, newest: int = VERSION) -> dict[str, Any]:
    """The object without its version, which must be one that is known."""
    if not isinstance(body, dict):
        raise FormatError(f"{source}: not an object")
    version = body.get("version")
    if type(version) is not int or version < 1:
        raise FormatError(f"{source}: version: {version!r} is not a version")
    if version > newest:
        raise ScanNewer(
            f"{source}: version {version}; this turnscan knows edits up to version {newest}",
            hint="install a newer turnscan",
        )
    return {k: v for k, v in body.items() if k != "version"}


def _dump(body: dict[str, Any]) -> str:
    import json

    return json.dumps(body, allow_nan=False, separators=(",", ":"))
