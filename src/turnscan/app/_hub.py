"""Hub: the browsers that are connected, what is sent to them, and which one is the operator."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping

from turnscan.app._envelope import Array, pack
from turnscan.app._limits import Allowances
from turnscan.app._protocol import Control, Model

QUEUE = 256
"""Messages that may wait for one browser; one that is further behind has to connect again."""
UNSHOWN = 2
"""Live pictures under way to one browser."""
CLIENTS = 8
_LATEST = frozenset({"beat", "frame", "devices", "scanning", "job"})
"""Kinds of which only the newest one counts."""


class Client:
    """One browser's end of the hub. Its methods belong to the thread of the event loop."""

    def __init__(self, remote: bool, browser: str) -> None:
        self.id = secrets.token_urlsafe(9)
        self.remote = remote
        """Whether it is on another computer."""
        self.browser = browser
        """The same for all pages of one browser."""
        self.joined = self.seen = time.monotonic()
        """When it came, and when a person last asked for something."""
        self.unshown: set[int] = set()
        """Numbers of live pictures that it has not acknowledged."""
        self.lost = False
        self._waiting: deque[tuple[str, str | bytes]] = deque()
        self._something = asyncio.Event()

    def put(self, key: str, message: str | bytes) -> None:
        """Queue a message; one with the same key that is still waiting gives way to it."""
        if key:
            for k, (waiting, _) in enumerate(self._waiting):
                if waiting == key:
                    del self._waiting[k]
                    break
        self._waiting.append((key, message))
        if len(self._waiting) > QUEUE:
            self.lost = True
        self._something.set()

    def drop(self) -> None:
        """Send no more, and hang up."""
        self.lost = True
        self._something.set()

    async def next(self) -> str | bytes | None:
        """The next message for it; None where it is too far behind, or is dropped."""
        while not self._waiting and not self.lost:
            self._something.clear()
            await self._something.wait()
        return None if self.lost else self._waiting.popleft()[1]


class Hub:
    """Who is there. `tell`, `operator` and `clients` may be used from any thread."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._clients: dict[str, Client] = {}
        self._operator: str | None = None
        self._alone_since = time.monotonic()
        self._loop: asyncio.AbstractEventLoop | None = None
        self.allowances = Allowances()
        self.hide: Callable[[str], str] = lambda text: text
        """What takes paths of this computer out of words that browsers get."""

    def run_in(self, loop: asyncio.AbstractEventLoop) -> None:
        """The loop in which clients live."""
        self._loop = loop

    @property
    def operator(self) -> Client | None:
        """The one that may edit, move and light."""
        with self._lock:
            return self._clients.get(self._operator or "")

    @property
    def clients(self) -> list[Client]:
        """All that are connected."""
        with self._lock:
            return list(self._clients.values())

    @property
    def unattended(self) -> float:
        """s for which there has been no operator, or it has not asked for anything."""
        with self._lock:
            operator = self.operator
            since = self._alone_since if operator is None else operator.seen
            return time.monotonic() - since

    def join(self, client: Client) -> bool:
        """Take a client in; the first becomes the operator. False where there are too many."""
        with self._lock:
            if len(self._clients) >= CLIENTS:
                return False
            self._clients[client.id] = client
            if self._operator is None:
                self._operator = client.id
        return True

    def leave(self, client: Client) -> None:
        """A client has disconnected.

        A page that is loaded anew may come before it has gone: the last page of its browser that
        came after its last request, and is not lost itself, is the operator then. Nobody else is
        without asking.
        """
        with self._lock:
            self._clients.pop(client.id, None)
            if self._operator == client.id:
                own = [c for c in self._clients.values() if c.browser == client.browser]
                later = [c for c in own if c.joined >= client.seen and not c.lost]
                self._operator = later[-1].id if later else None
                self._alone_since = time.monotonic()
        self.tell_control()

    def take(self, client: Client) -> None:
        """A client becomes the operator."""
        with self._lock:
            self._operator = client.id
        self.tell_control()

    def release(self, client: Client) -> None:
        """A client is the operator no more."""
        with self._lock:
            if self._operator != client.id:
                return
            self._operator, self._alone_since = None, time.monotonic()
        self.tell_control()

    def tell(
        self,
        message: Model,
        arrays: Mapping[str, Array] | None = None,
        *,
        to: Client | None = None,
    ) -> None:
        """Send a message to everybody, or to one."""
        kind = getattr(message, "kind", "")
        key = f"{kind} {getattr(message, 'job', '')}" if kind in _LATEST else ""
        data: str | bytes
        if arrays is None:
            data = message.model_dump_json()
        else:
            data = pack(message.model_dump(mode="json"), arrays)
        number = getattr(message, "number", None) if kind == "frame" else None

        def deliver() -> None:
            for client in self.clients if to is None else [to]:
                if number is not None:
                    if len(client.unshown) >= UNSHOWN:
                        continue
                    client.unshown.add(number)
                client.put(key, data)

        if self._loop is not None:
            with contextlib.suppress(RuntimeError):  # the server has ended: nobody listens
                self._loop.call_soon_threadsafe(deliver)

    def tell_control(self) -> None:
        """Tell everybody who the operator is."""
        with self._lock:
            # Under the lock: the last that is said of it is how it is.
            self.tell(Control(operator=self._operator, clients=len(self._clients)))
