"""Doors: what every request has to pass, before there is any talk of routes.

Host, Origin, cookie and header are judged here, as middleware, so that a route cannot be without
it; every answer, errors too, gets the headers that keep a browser from lending the page to others.
"""

from __future__ import annotations

import asyncio
import ipaddress
import logging
import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from turnscan.app._auth import Keys
from turnscan.errors import TurnscanError

CSP = (
    "default-src 'self'; img-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; "
    "worker-src 'self' blob:; connect-src 'self'; object-src 'none'; base-uri 'none'; "
    "form-action 'self'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": CSP,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}
OWN_HEADER = "x-turnscan"
SAFE = ("GET", "HEAD")
OPEN = frozenset({"/login", "/login.js", "/login.css"})
"""All that is answered without a cookie."""
HEADER_BYTES = 16 * 1024
JSON_BYTES = 2**20
BODY_SECONDS = 10.0
"""s for a body, or for the next piece of an upload."""
REST_SECONDS = 1.0
"""s for what is left of a body that was answered before it was read."""
_URL_BYTES = 4096

_STATUS = {2: 400, 3: 503, 5: 409}
"""By the exit code that the same error has on the command line."""

_log = logging.getLogger("turnscan.app")

_STRANGER = """<!doctype html><html lang="en"><meta charset="utf-8"><title>turnscan</title>
<link rel="stylesheet" href="/login.css"><main><h1>turnscan</h1>
<p>This browser is not authorised. Open the link that turnscan printed last.</p></main></html>"""


@dataclass(frozen=True)
class Names:
    """What this server may be called in a URL."""

    hosts: frozenset[str]
    """host:port, as a browser writes it in Host."""
    port: int
    remote: bool
    """Whether the address that a connection came in by is a name, too."""

    def host(self, text: str, server: str) -> bool:
        """Whether a Host header names this server; exactly, as browsers write it."""
        return text in self.hosts or (self.remote and text == _with_port(server, self.port))

    def origin(self, text: str, server: str) -> bool:
        """Whether an Origin header is one of this server's own pages."""
        scheme, colon, rest = text.partition("://")
        return scheme == "http" and bool(colon) and self.host(rest, server)


def names(port: int, extra: Iterable[str] = (), remote: bool = False) -> Names:
    """The loopback's names, and ``extra`` ones."""
    hosts = ["127.0.0.1", "localhost", "::1", *extra]
    return Names(frozenset(_with_port(h, port) for h in hosts), port, remote)


def is_loopback(address: str) -> bool:
    """Whether a connection came from this computer."""
    try:
        ip = ipaddress.ip_address(address)
    except ValueError:
        return False
    mapped = getattr(ip, "ipv4_mapped", None)
    return (mapped or ip).is_loopback


def problem(status: int, text: str, hint: str = "", code: str = "", **headers: str) -> Response:
    """The body of every HTTP error."""
    body = {"code": code or HTTPStatus(status).phrase.lower(), "text": text, "hint": hint}
    named = {k.replace("_", "-"): v for k, v in headers.items()}
    return JSONResponse(body, status, headers=named)


def name_of(error: Exception) -> str:
    """The code that a kind of error has in messages: DeviceTimeout is device-timeout."""
    words = re.findall(r"[A-Z][a-z]+", type(error).__name__)
    return "-".join(words).lower() or "mistake"


class Doors:
    """ASGI middleware around everything."""

    def __init__(
        self,
        app: ASGIApp,
        *,
        keys: Keys,
        names: Names,
        uploads: frozenset[str],
        hide: Callable[[str], str],
    ) -> None:
        """``hide`` takes paths of this computer out of words."""
        self._app, self._keys, self._names = app, keys, names
        self._uploads, self._hide = uploads, hide
        self.cookie = f"turnscan-{names.port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Judge, then pass on."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        refusal = self._judge(scope)
        if scope["type"] == "websocket":
            if refusal is not None:
                await refusal(scope, receive, send)
                return
            scope["browser"] = self.cookie_of(Headers(scope=scope))
            await self._app(scope, receive, send)
            return
        guarded = _Guarded(scope, receive, send, scope["path"] in self._uploads)
        try:
            await (refusal or self._app)(scope, guarded.receive, guarded.send)
        except ClientDisconnect:
            return  # nobody is there to be answered
        except _TooLate:
            await guarded.fail(problem(408, "the request timed out"))
        except _TooLarge:
            text = f"a body of more than {JSON_BYTES >> 20} MB"
            await guarded.fail(problem(413, text, code="too-large"))
        except HTTPException as e:
            await guarded.fail(problem(e.status_code, HTTPStatus(e.status_code).phrase))
        except TurnscanError as e:
            await guarded.fail(
                problem(_STATUS.get(e.exit_code, 500), e.message, str(e.hint), name_of(e))
            )
        except Exception as e:  # noqa: BLE001 the door: whatever is left is our mistake
            _log.error("internal error (%s) at %s", type(e).__name__, _route(scope))
            text = "internal error"
            await guarded.fail(problem(500, text, "please report it", "mistake"))

    def _judge(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        server = scope["server"][0] if scope.get("server") else ""
        hosts, origins = headers.getlist("host"), headers.getlist("origin")
        path = scope["path"]
        if not path.startswith("/") or len(scope.get("raw_path", b"")) > _URL_BYTES:
            return problem(400, "unknown path")
        if sum(len(k) + len(v) for k, v in scope["headers"]) > HEADER_BYTES:
            return problem(431, "the request header is too large")
        if len(hosts) != 1 or not self._names.host(hosts[0], server):
            return problem(421, "the request names another server")
        foreign = len(origins) > 1 or any(not self._names.origin(o, server) for o in origins)
        if foreign or _from_elsewhere(scope, headers):
            return problem(403, "the request came from another page", code="origin")
        if path not in OPEN and not self._keys.known(self.cookie_of(headers)):
            if scope["type"] == "http" and "text/html" in headers.get("accept", ""):
                return HTMLResponse(_STRANGER, 401)
            hint = "open the link that turnscan printed last"
            return problem(401, "this browser is not authorised", hint)
        if scope["type"] == "websocket":
            return None if origins else problem(403, "a page must name its origin", code="origin")
        unsafe = scope["method"] not in SAFE
        if unsafe and not (origins and headers.get(OWN_HEADER) == "1"):
            return problem(403, "a change needs Origin and X-Turnscan", code="origin")
        return None

    def cookie_of(self, headers: Headers) -> str:
        """The value of our cookie, empty where there is none."""
        jar: SimpleCookie = SimpleCookie()
        try:
            jar.load(headers.get("cookie", ""))
        except CookieError:
            return ""
        return jar[self.cookie].value if self.cookie in jar else ""


class _TooLarge(Exception):
    pass


class _TooLate(Exception):
    pass


class _Guarded:
    """Receive and send of one request, with limits and headers."""

    def __init__(self, scope: Scope, receive: Receive, send: Send, upload: bool) -> None:
        self._scope, self._receive, self._send = scope, receive, send
        self._left = math.inf if upload else JSON_BYTES
        self._upload = upload
        self._deadline = asyncio.get_running_loop().time() + BODY_SECONDS
        self._begun = False
        self._whole = False

    async def receive(self) -> Message:
        """The next piece of the body."""
        if self._whole:
            return await self._receive()
        loop = asyncio.get_running_loop()
        left = BODY_SECONDS if self._upload else self._deadline - loop.time()
        try:
            message = await asyncio.wait_for(self._receive(), max(left, 0.0))
        except TimeoutError:
            raise _TooLate from None
        self._whole = not message.get("more_body", False)
        self._left -= len(message.get("body", b""))
        if self._left < 0:
            raise _TooLarge
        return message

    async def send(self, message: Message) -> None:
        """Pass on, with our headers."""
        if message["type"] == "http.response.start":
            self._begun = True
            given = {name.lower() for name, _ in message["headers"]}
            ours = [(k.lower().encode(), v.encode()) for k, v in HEADERS.items()]
            if b"cache-control" not in given:
                ours.append((b"cache-control", b"no-store"))
            if self._scope["method"] not in SAFE and not await self._read_on():
                ours.append((b"connection", b"close"))
            message["headers"] = [*message["headers"], *ours]
        await self._send(message)

    async def _read_on(self) -> bool:
        """Whether the body is read to its end; a short rest is read now and thrown away.

        A connection that is closed with bytes nobody read is reset, and the answer may be lost.
        """
        loop = asyncio.get_running_loop()
        end, left = loop.time() + REST_SECONDS, JSON_BYTES
        while not self._whole and left > 0:
            try:
                message = await asyncio.wait_for(self._receive(), max(end - loop.time(), 0.0))
            except TimeoutError:
                break
            left -= len(message.get("body", b""))
            self._whole = not message.get("more_body", False)
        return self._whole

    async def fail(self, answer: Response) -> None:
        """Answer with an error, where nothing has been answered yet."""
        if not self._begun:
            await answer(self._scope, self._receive, self.send)


def _from_elsewhere(scope: Scope, headers: Headers) -> bool:
    """Whether the browser says that another site's page asked; a link that was followed may."""
    site = headers.get("sec-fetch-site", "none")
    if site in ("none", "same-origin"):
        return False
    followed = headers.get("sec-fetch-mode") == "navigate"
    document = headers.get("sec-fetch-dest") == "document"
    page = scope["path"] in ("/", "/login")
    return not (page and followed and document and scope.get("method") == "GET")


def _route(scope: Scope) -> str:
    route = scope.get("route")
    return str(getattr(route, "path", "an unknown route"))


def _with_port(host: str, port: int) -> str:
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
