"""The cable between a computer and a board, and what may happen to the bytes on it."""

from __future__ import annotations

from collections import deque
from random import Random


class Cable:
    """Carries bytes whole and at once, unless it is set otherwise.

    Set at any moment: ``late`` s that answers take; ``piece`` bytes and ``gap`` s between pieces,
    where an answer comes in parts; how many of the next answers to ``lose`` or ``double``; the
    fraction of bytes towards the board that it is to ``drop`` or ``spoil``.
    """

    def __init__(self, seed: int = 0) -> None:
        self._random = Random(seed)  # noqa: S311 (repeatable faults, no secrets)
        self._up: deque[tuple[float, bytes]] = deque()
        self.repair()

    def repair(self) -> None:
        """As good as new; what is on its way arrives."""
        self.late = self.gap = self.drop = self.spoil = 0.0
        self.piece = self.lose = self.double = 0

    def cut(self) -> None:
        """What is on its way is lost."""
        self._up.clear()

    def up(self, data: bytes, now: float) -> None:
        """An answer sets out from the board at a time, s."""
        if not data:
            return
        if self.lose:
            self.lose -= 1
            return
        if self.double:
            self.double -= 1
            data += data
        piece = self.piece or len(data)
        when = max(now + self.late, self._up[-1][0] if self._up else 0.0)
        for at in range(0, len(data), piece):
            self._up.append((when, data[at : at + piece]))
            when += self.gap

    def arrived(self, now: float) -> bytes:
        """What has arrived at the computer."""
        data = b""
        while self._up and self._up[0][0] <= now:
            data += self._up.popleft()[1]
        return data

    def wake(self) -> float | None:
        """When the next bytes arrive, s."""
        return self._up[0][0] if self._up else None

    def down(self, data: bytes) -> bytes:
        """What arrives at the board."""
        if not (self.drop or self.spoil):
            return data
        kept = bytes(b for b in data if self._random.random() >= self.drop)
        return bytes(
            self._random.randrange(256) if self._random.random() < self.spoil else b for b in kept
        )
