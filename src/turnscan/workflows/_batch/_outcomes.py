"""The outcomes of a batch, packed: a batch of any length keeps little of each."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator, Sequence
from typing import overload

from turnscan.workflows._batch._task import Outcome, outcome_from_json


class Outcomes(Sequence[Outcome]):
    """Outcomes in an order of their own; each is unpacked when it is asked for.

    Unpacked, one takes 4 kB and more; packed some 300 bytes, as they tell much the same.
    """

    def __init__(self, packed: Iterable[PackedOutcome] = ()) -> None:
        self._packed = tuple(packed)

    @overload
    def __getitem__(self, index: int) -> Outcome: ...
    @overload
    def __getitem__(self, index: slice) -> Outcomes: ...
    def __getitem__(self, index: int | slice) -> Outcome | Outcomes:
        """One outcome, or some of them. Raises IndexError."""
        if isinstance(index, slice):
            return Outcomes(self._packed[index])
        return self._packed[index].outcome()

    def __iter__(self) -> Iterator[Outcome]:
        """All, one after the other."""
        return (packed.outcome() for packed in self._packed)

    def __len__(self) -> int:
        """How many there are."""
        return len(self._packed)

    def __eq__(self, other: object) -> bool:
        """Whether they tell the same, in the same order."""
        return isinstance(other, Outcomes) and list(self) == list(other)

    __hash__ = None  # type: ignore[assignment]


class PackedOutcome:
    """An outcome, compressed with the words of another one."""

    __slots__ = ("_data", "_words", "reused")

    def __init__(self, outcome: Outcome, like: PackedOutcome | None = None) -> None:
        text = outcome.to_json().encode()
        self._words: bytes = text if like is None else like._words
        packer = zlib.compressobj(zdict=self._words)
        self._data = packer.compress(text) + packer.flush()
        self.reused = outcome.reused

    def outcome(self) -> Outcome:
        """As it was."""
        text = zlib.decompressobj(zdict=self._words).decompress(self._data)
        return outcome_from_json(text.decode(), "outcome of a batch", reused=self.reused)
