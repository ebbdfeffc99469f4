"""The server: a port, the doors, the workshop behind them, and an end on Ctrl-C."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
import socket
import webbrowser
from collections.abc import AsyncIterator, Callable, Generator
from dataclasses import dataclass
from typing import Any

import uvicorn
from starlette.routing import Router
from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from turnscan.app._auth import Keys
from turnscan.app._request_guard import HEADER_BYTES, Doors, is_loopback, names
from turnscan.app._routes import UPLOADS, routes
from turnscan.app._socket import MESSAGE_BYTES
from turnscan.app._workshop import Workshop
from turnscan.errors import InputError, SafetyError
from turnscan.memory import share_pools

HEADER_SECONDS = 10.0
"""s in which the head of a connection's first request has to come."""
PING_SECONDS = 30.0
_CONNECTIONS = 256


@dataclass(frozen=True)
class Listening:
    """Where to listen, and for whom."""

    host: str = "127.0.0.1"
    port: int = 0
    allow_remote: bool = False

    def __post_init__(self) -> None:
        """Raise InputError where others could connect though that is not allowed."""
        if not self.allow_remote and self.host != "localhost" and not is_loopback(self.host):
            raise InputError(
                f"--host {self.host}: other computers would be able to connect",
                hint="add --allow-remote to permit this, and read docs/how-to/workshop.md",
            )


def bind(where: Listening) -> socket.socket:
    """The listening socket. Raises InputError where it cannot be had."""
    try:
        family, _, _, _, address = socket.getaddrinfo(
            where.host, where.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        opened = socket.create_server(address[:2], family=family, backlog=64)
    except (OSError, OverflowError) as e:
        why = getattr(e, "strerror", None) or str(e)
        raise InputError(
            f"{where.host}:{where.port}: cannot listen there ({why})",
            hint="choose another --port, or leave it out for a free one",
        ) from None
    opened.setblocking(False)
    return opened


def application(
    workshop: Workshop, keys: Keys, port: int, host: str = "127.0.0.1", remote: bool = False
) -> ASGIApp:
    """Doors around routes around the workshop, as one ASGI application."""
    named = [host] if host not in ("0.0.0.0", "::", "") else []  # noqa: S104 compared, not bound
    if remote:
        named += [socket.gethostname(), f"{socket.gethostname()}.local"]
    allowed = names(port, named, remote)
    cookie = f"turnscan-{port}"

    @contextlib.asynccontextmanager
    async def life(_: object) -> AsyncIterator[None]:
        workshop.hub.run_in(asyncio.get_running_loop())
        try:
            yield
        finally:
            try:
                await asyncio.to_thread(workshop.close)
            except SafetyError as e:  # the server would drop it; `serve` raises it
                workshop.unsafe = e

    router = Router(routes(workshop, keys, cookie), redirect_slashes=False, lifespan=life)

    async def inside(scope: Scope, receive: Receive, send: Send) -> None:
        scope["workshop"] = workshop
        scope["app"] = router  # unknown paths are exceptions, which the doors put into words
        await router(scope, receive, send)

    return Doors(inside, keys=keys, names=allowed, uploads=UPLOADS, hide=workshop.hub.hide)


class Server(uvicorn.Server):
    """uvicorn, ended by any polite signal, and telling when it listens."""

    def __init__(self, app: ASGIApp, listening: Callable[[], None] = lambda: None) -> None:
        super().__init__(
            uvicorn.Config(
                app,
                http=_Http,
                ws="websockets-sansio",
                ws_max_size=MESSAGE_BYTES,
                ws_per_message_deflate=False,
                ws_ping_interval=PING_SECONDS,
                ws_ping_timeout=2 * PING_SECONDS,
                lifespan="on",
                log_config=None,
                access_log=False,
                proxy_headers=False,
                server_header=False,
                date_header=False,
                h11_max_incomplete_event_size=HEADER_BYTES,
                timeout_graceful_shutdown=5,
            )
        )
        self._listening = listening

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start, then say so."""
        await super().startup(sockets)
        self._listening()

    @contextlib.contextmanager
    def capture_signals(self) -> Generator[None, None, None]:
        """Ctrl-C, a polite kill and hanging up are an ordinary end."""
        wanted = [getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]
        try:
            before = {number: signal.signal(number, self.handle_exit) for number in wanted}
        except ValueError:  # not in the main thread: somebody else ends us
            yield
            return
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


class _Http(H11Protocol):
    """HTTP/1.1 with a deadline for the first request's head, and an end to connections."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        if len(self.connections) > _CONNECTIONS:
            transport.abort()
            return
        self._deadline = self.loop.call_later(HEADER_SECONDS, self._too_late)

    def handle_events(self) -> None:
        super().handle_events()
        if self.scope is not None:  # a request's head is here
            self._in_time()

    def connection_lost(self, exc: Exception | None) -> None:
        self._in_time()
        super().connection_lost(exc)

    def _in_time(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _too_late(self) -> None:
        if self.transport.get_protocol() is self:  # and not that of a WebSocket
            self.transport.close()


def serve(
    workshop: Workshop, where: Listening, say: Callable[[str], Any], browser: bool = True
) -> None:
    """Listen until somebody ends it; lasers are dark and files closed when this returns.

    ``say`` gets a link for one browser, and another one each time one was used. Raises InputError
    where the port cannot be had, and SafetyError where a laser may still be lit at the end.
    """
    logging.getLogger("uvicorn").setLevel(logging.CRITICAL)
    share_pools()
    opened = bind(where)
    port = int(opened.getsockname()[1])
    shown = where.host
    if shown in ("0.0.0.0", "::", ""):  # noqa: S104 compared, not bound
        shown = socket.gethostname()

    def link() -> str:
        return f"http://{f'[{shown}]' if ':' in shown else shown}:{port}/login#{keys.invite()}"

    keys = Keys(spent=lambda: say(link()))
    app = application(workshop, keys, port, where.host, where.allow_remote)

    def listening() -> None:
        first = link()
        say(first)
        if browser:
            asyncio.get_running_loop().run_in_executor(None, _open_browser, first)

    Server(app, listening).run([opened])
    if workshop.unsafe is not None:
        raise workshop.unsafe


def _open_browser(link: str) -> None:
    with contextlib.suppress(webbrowser.Error, OSError):
        webbrowser.open(link)
