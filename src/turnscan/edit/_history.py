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
    DeleteSet,
    Edit,
    KeepSet,
    RenameSet,
    SetEdit,
    bad_key,
    edit_from_value,
    edit_to_value,
)
from turnscan.errors import FormatError, InputError, ScanNewer
from turnscan.json_text import strict_json

VERSION = 4
"""Of the log; what older programs can read is written as version 1."""
MOST_NAME = 80
"""Letters of the name of an edit."""
_NEWEST_FILE = 3
"""Version of a file of edits; one without names and settings is written as version 1."""
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
    cursor: Annotated[int, Field(ge=0, le=_MOST, strict=True)] | None = None
    """So many edits of it count; None: all."""
    do: Literal["branch"] = "branch"


@dataclass(frozen=True)
class Name:
    """An edit got a name by which a person finds it again; an empty one takes it away."""

    __pydantic_config__ = _STRICT
    id: Id
    name: Annotated[str, Field(max_length=MOST_NAME, strict=True)]
    do: Literal["name"] = "name"


Action = Add | Branch | Go | Name | Switch
_ACTION: TypeAdapter[Action] = TypeAdapter(Annotated[Action, Field(discriminator="do")])


@dataclass(frozen=True)
class Entry:
    """One edit in the history."""

    id: int
    """Its number for ever; those of discarded edits are not used again."""
    edit: Edit
    on: bool = True
    """False for one that was switched off."""
    name: str = ""
    """Given by a person; empty for none."""

    @property
    def place(self) -> str:
        """How findings name it."""
        return f"edit {self.id} ({self.edit.kind})"


@dataclass(frozen=True)
class Fork:
    """A piece of the tree of all edits that is not in the history."""

    after: int
    """Number of the edit it grows from; 0: it begins with the first edit."""
    entries: tuple[Entry, ...]
    """Its edits in their order, none of which is in another piece."""


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

    @property
    def forks(self) -> tuple[Fork, ...]:
        """The branches without what they share with the history or a newer branch, newest first."""
        seen = {e.id for e in self.entries}
        out = list[Fork]()
        for path in reversed(self.branches):
            own = tuple(e for e in path if e.id not in seen)
            start = len(path) - len(own)
            if own:
                out.append(Fork(path[start - 1].id if start else 0, own))
            seen |= {e.id for e in own}
        return tuple(out)

    def branch(self, id: int) -> Branch:
        """The action that takes up the newest branch with this edit, up to it. Raises InputError.

        What comes after the edit in that branch can be redone.
        """
        for path in reversed(self.branches):
            at = next((i for i, e in enumerate(path, start=1) if e.id == id), None)
            if at is not None:
                return Branch(path[-1].id, None if at == len(path) else at)
        raise InputError(f"neither the history nor a branch has an edit {id}")

    def to(self, id: int) -> Go | Branch:
        """The action to the state after an edit of the history or of a branch; 0: as scanned.

        Raises InputError.
        """
        if id == 0:
            return Go(0)
        at = next((i for i, e in enumerate(self.entries, start=1) if e.id == id), None)
        return self.branch(id) if at is None else Go(at)

    def naming(self, id: int, name: str) -> Name:
        """The action that names an edit, of the history or a branch. Raises InputError."""
        name = name.strip()
        if len(name) > MOST_NAME or not name.isprintable():
            raise InputError(
                f"{name[:MOST_NAME]!r}: no name of an edit",
                hint=f"take at most {MOST_NAME} letters, in one line",
            )
        if all(e.id != id for path in (self.entries, *self.branches) for e in path):
            raise _unknown(id)
        return Name(id, name)

    def switch(self, id: int, on: bool) -> Switch:
        """The action that switches one edit on or off. Raises InputError where there is none."""
        if all(e.id != id for e in self.entries):
            raise _unknown(id)
        return Switch(id, on)

    def is_at(self, action: Action) -> bool:
        """Whether an action of the history would leave everything as it is."""
        match action:
            case Go():
                return action.cursor == self.cursor
            case Switch():
                return any(e.id == action.id and e.on == action.on for e in self.entries)
            case Name():
                every = (e for path in (self.entries, *self.branches) for e in path)
                return all(e.name == action.name for e in every if e.id == action.id)
        return False

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
                cursor = len(path) if action.cursor is None else action.cursor
                if cursor > len(path):
                    raise InputError(f"that branch has {len(path)} edits, so none after {cursor}")
                return replace(self, entries=path, cursor=cursor, branches=self._with_branch(path))
            case Name():
                entries, *branches = (
                    tuple(replace(e, name=action.name) if e.id == action.id else e for e in path)
                    for path in (self.entries, *self.branches)
                )
                if (entries, *branches) == (self.entries, *self.branches):
                    self.naming(action.id, action.name)  # whether there is such an edit
                return replace(self, entries=entries, branches=tuple(branches))
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
    body = asdict(action)
    match action:
        case Add(edit=ChangeSettings()):
            version = 3
        case Branch(cursor=None):
            version = 2
            del body["cursor"]
        case Branch() | Name() | Add(edit=KeepSet() | RenameSet() | DeleteSet()):
            version = 4
        case _:
            version = 1
    return _dump({"version": version, **body})


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
    done = history.entries[: history.cursor]
    version = 2 if any(isinstance(e.edit, ChangeSettings) for e in done) else 1
    if any(e.name or isinstance(e.edit, SetEdit) for e in done):
        version = _NEWEST_FILE
    edits = [
        {"id": e.id, "on": e.on, "edit": edit_to_value(e.edit)}
        | ({"name": e.name} if e.name else {})
        for e in done
    ]
    return _dump({"format": "turnscan-edits", "version": version, "edits": edits})


def history_from_json(text: str, source: str = "edits") -> History:
    """A file that `history_to_json` wrote. Raises FormatError naming the key, ScanNewer."""
    body = strict_json(text, source)
    if not isinstance(body, dict) or body.get("format") != "turnscan-edits":
        raise FormatError(
            f"{source}: format: not an edits file",
            hint="make one with turnscan edits SCAN -o FILE.json",
        )
    body = _versioned(body, source, _NEWEST_FILE)
    edits = body.get("edits")
    if set(body) != {"format", "edits"} or not isinstance(edits, list) or len(edits) > _MOST:
        raise FormatError(f"{source}: edits: not a list of at most {_MOST} edits")
    history = History()
    for i, item in enumerate(edits):
        where = f"{source}: edits.{i}"
        if not isinstance(item, dict) or set(item) - {"name"} != {"id", "on", "edit"}:
            raise FormatError(f"{where}: not an object of id, on and edit, and perhaps a name")
        if type(item["id"]) is not int or type(item["on"]) is not bool:
            raise FormatError(f"{where}: id is not a whole number, or on not true or false")
        if not isinstance(item["edit"], dict):
            raise FormatError(f"{where}.edit: not an object")
        if not isinstance(item.get("name", ""), str):
            raise FormatError(f"{where}.name: not a text")
        try:
            history = history.after(Add(item["id"], edit_from_value(item["edit"], where)))
        except FormatError:
            raise
        except InputError as e:
            raise FormatError(f"{where}.id: {e.message}") from None
        if item.get("name"):
            try:
                history = history.after(history.naming(item["id"], item["name"]))
            except InputError as e:
                raise FormatError(f"{where}.name: {e.message}") from None
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
