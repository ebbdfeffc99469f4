"""The locked doors (W1 to W20): every row over the routes that the router itself lists."""

from __future__ import annotations

import contextlib
import json
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from tests.web.running import PATIENCE, Browser, Running, raw, serving
from turnscan.app import Workshop, _request_guard, _server
from turnscan.app._auth import FAILURES, Keys
from turnscan.app._library import Library, safe_name
from turnscan.app._request_guard import OPEN, Doors, is_loopback, names
from turnscan.app._routes import routes
from turnscan.errors import InputError

ORIGINS = (
    "null",
    "http://127.0.0.1.evil.com",
    "http://localhost:{port}@evil.com",
    "http://127.0.0.1:1",
    "https://127.0.0.1:{port}",
    "HTTP://127.0.0.1:{port}",
    "http://LOCALHOST:{port}",
    "http://127.0.0.1:{port}/",
    "http://127.0.0.1:{port}.evil.com",
    "http://[::1]:1",
    "file://",
    "",
)
HOSTS = (
    "evil.com",
    "evil.com:{port}",
    "localhost.:{port}",
    "localhost",
    "127.0.0.1",
    "127.0.0.1:1",
    "2130706433:{port}",
    "127.1:{port}",
    "0.0.0.0:{port}",
    "[::ffff:127.0.0.1]:{port}",
    "[::1]",
    "127.0.0.1:{port}@evil.com",
    "LOCALHOST:{port}",
    "",
)
PLACES = (
    *("..", "../..", "../etc/passwd", "%2e%2e", "%2e%2e%2f", "%252e%252e%252f", "..%2f..%2f"),
    *("..;/", "..;", "..\\", "..%5c", "%5c..%5c", "//", "/", "%2f", "%00", "x%00.turnscan"),
    *("../scans2", "scans2", "C:", "C:%5cWindows", "C:/Windows", "%5c%5chost%5cshare"),
    *("%c0%ae%c0%ae", "%c0%af", "%e0%80%ae", "%uff0e%uff0e", "....//", "....%5c%5c", "~", "~root"),
    *("%2e%2e%5c", ".%2e", "%2e.", ".", "%2e", "ball.turnscan", "ball", "*", "?", "%3f", "#"),
    *("con", "nul", "aux", "com1", "file:%2f%2f%2fetc%2fpasswd", "http:%2f%2fevil", "-", "--help"),
    *("$(id)", "%60id%60", "%3b%20id", "%7cid", "%0d%0aX:1", "%0aid", "%09", "%20", "%ff", "%"),
    *("A" * 2000, "9" * 400, "-1", "1e9", "0x0", "%2b1", "NaN", "1.5", "00000000001"),
    *("index.html", "assets", "assets/../../_server.py", "assets/%2e%2e/%2e%2e/_server.py"),
    *("%2e%2e/_auth.py", "..%2f_auth.py", "..%252f_auth.py", "login/../../_auth.py", ".git"),
    *("..%2f..%2f..%2f..%2f..%2f..%2fetc%2fpasswd", "/etc/passwd", "%2fetc%2fpasswd"),
    *("__init__.py", "_server.py", "login/login.html", "..%c1%9c..", "..%25c0%25af"),
    *("..%u2216", "%%32%65%%32%65", "..%0d%0a", "..%09/", "..%20/", "..%00/", "%3f/..%2f.."),
    *("<script>alert(1)</script>", "%3cscript%3e", "'%20or%201=1--", "{scan}", "%7bscan%7d"),
)


def _listed() -> list[tuple[str, str, str]]:
    """Kind, method and a path of every route there is, as the router lists them."""
    workshop = Workshop(Library(Path()))
    out: list[tuple[str, str, str]] = []

    def walk(found: list[BaseRoute], before: str) -> None:
        for route in found:
            if isinstance(route, Mount) and route.routes:
                walk(list(route.routes), before + route.path)
            elif isinstance(route, Mount):
                out.append(("http", "GET", before + route.path + "/index.html"))
            elif isinstance(route, WebSocketRoute):
                out.append(("ws", "GET", before + route.path))
            elif isinstance(route, Route):
                path = (before + route.path).replace(":int", "")
                for name in ("scan", "download", "file", "picture", "upload"):
                    path = path.replace(f"{{{name}}}", "abcdefgh")
                for name in ("grid", "step", "view"):
                    path = path.replace(f"{{{name}}}", "0")
                assert "{" not in path, f"the tests do not know a parameter of {path}"
                out.extend(("http", m, path) for m in sorted((route.methods or set()) - {"HEAD"}))

    walk(routes(workshop, Keys(), "cookie"), "")
    workshop.close()
    return out


ROUTES = _listed()
HTTP = [(method, path) for kind, method, path in ROUTES if kind == "http"]
SOCKETS = [path for kind, _, path in ROUTES if kind == "ws"]
LOCKED = [(method, path) for method, path in HTTP if path not in OPEN]


@pytest.fixture(scope="module")
def locked(
    tmp_path_factory: pytest.TempPathFactory, scan_bytes: bytes
) -> Iterator[tuple[Running, str]]:
    """A server that no test of this module changes, and a cookie for it."""
    folder = tmp_path_factory.mktemp("locked")
    (folder / "ball.turnscan").write_bytes(scan_bytes)
    with serving(folder) as running:
        yield running, running.login()


Locked = tuple[Running, str]


@pytest.fixture(scope="session", autouse=True)
def _client() -> Iterator[None]:
    """Nothing is left open; not sooner, as a worker may come back to this module."""
    yield
    _CLIENT.close()


def test_the_list_of_routes_is_the_whole_list() -> None:
    assert len(HTTP) >= 13
    assert SOCKETS == ["/ws"]
    assert {path for _, path in HTTP} >= {"/", "/login", "/api/scans", "/api/invitations"}
    assert set(OPEN) <= {path for _, path in HTTP}


# W1


@pytest.mark.parametrize(("method", "path"), LOCKED)
def test_nothing_without_a_good_cookie(locked: Locked, method: str, path: str) -> None:
    server, cookie = locked
    name, value = cookie.split("=")
    for bad in (None, f"{name}=", f"{name}={'A' * 43}", f"{name}={value[:-1]}", f"other={value}",
                f"{name}={value}A", f"{name}={server.keys.invite()}"):  # fmt: skip
        headers = {"Origin": server.base, "X-Turnscan": "1"}
        if bad is not None:
            headers["Cookie"] = bad
        answer = _request(method, server.base + path, headers=headers)
        assert answer.status_code == 401, (bad, answer.text)
    good = _request(
        method, server.base + path,
        headers={"Origin": server.base, "X-Turnscan": "1", "Cookie": cookie},
    ) if path != "/api/logout" else None  # fmt: skip
    assert good is None or good.status_code != 401


@pytest.mark.parametrize("path", SOCKETS)
def test_no_socket_without_a_good_cookie(locked: Locked, path: str) -> None:
    server, cookie = locked
    for bad in ({}, {"Cookie": cookie[:-1]}, {"Cookie": f"turnscan-{server.port}="}):
        assert _refused(server, path, server.base, bad) == 401
    assert _refused(server, path, server.base, {"Cookie": cookie}) is None


def test_a_token_is_good_once_and_for_some_time_only() -> None:
    now = [0.0]
    keys = Keys(lambda: now[0])
    token = keys.invite()
    cookie = keys.enter(token, "a")
    assert cookie is not None
    assert keys.known(cookie)
    assert keys.enter(token, "a") is None
    late = keys.invite()
    now[0] += 13 * 3600
    assert keys.enter(late, "b") is None
    assert keys.known(cookie)
    now[0] += 8 * 24 * 3600
    assert not keys.known(cookie)
    assert len(token) >= 43


def test_secrets_are_compared_in_constant_time() -> None:
    source = (Path(__file__).parents[2] / "src/turnscan/app/_auth.py").read_text()
    assert "hmac.compare_digest(known, digest)" in source
    assert "break" not in source  # all are compared, whether one was found or not


# W2


@pytest.mark.parametrize("origin", ORIGINS)
def test_no_request_from_another_origin(locked: Locked, origin: str) -> None:
    server, cookie = locked
    text = origin.format(port=server.port)
    headers = {"Origin": text, "X-Turnscan": "1", "Cookie": cookie}
    for method, path in HTTP:
        answer = _request(method, server.base + path, headers=headers)
        assert answer.status_code == 403, (method, path)
    for path in SOCKETS:
        assert _refused(server, path, text, {"Cookie": cookie}) == 403


@pytest.mark.parametrize(("method", "path"), [r for r in HTTP if r[0] != "GET"])
def test_a_change_needs_an_origin_and_our_header(locked: Locked, method: str, path: str) -> None:
    server, cookie = locked
    for headers in ({}, {"Origin": server.base}, {"X-Turnscan": "1"},
                    {"Origin": server.base, "X-Turnscan": "0"}):  # fmt: skip
        answer = _request(method, server.base + path, headers={**headers, "Cookie": cookie})
        assert answer.status_code == 403


def test_a_socket_needs_an_origin(locked: Locked) -> None:
    server, cookie = locked
    assert _refused(server, "/ws", None, {"Cookie": cookie}) == 403


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_pictures_and_scripts_of_other_pages_get_nothing(locked: Locked, site: str) -> None:
    server, cookie = locked
    for dest, mode in (("image", "no-cors"), ("script", "no-cors"), ("iframe", "navigate")):
        for method, path in HTTP:
            headers = {"Sec-Fetch-Site": site, "Sec-Fetch-Dest": dest, "Sec-Fetch-Mode": mode}
            answer = _request(method, server.base + path, headers={**headers, "Cookie": cookie})
            assert answer.status_code == 403, (path, dest)
    link = {"Sec-Fetch-Site": site, "Sec-Fetch-Dest": "document", "Sec-Fetch-Mode": "navigate"}
    assert _request("GET", f"{server.base}/login", headers=link).status_code == 200


# W3


@pytest.mark.parametrize("host", HOSTS)
def test_no_other_name_for_this_server(locked: Locked, host: str) -> None:
    server, cookie = locked
    text = host.format(port=server.port)
    for path in ("/", "/login", "/api/scans/abcdefgh/mesh", "/ws"):
        answer = raw(
            server.port,
            f"GET {path} HTTP/1.1\r\nHost: {text}\r\nCookie: {cookie}\r\n"
            "Connection: close\r\n\r\n".encode(),
        )
        assert answer.split(b" ")[1] in (b"421", b"400"), answer[:100]


def test_two_hosts_none_and_absolute_forms_are_refused(locked: Locked) -> None:
    server, cookie = locked
    host = f"127.0.0.1:{server.port}"
    tail = f"Cookie: {cookie}\r\nConnection: close\r\n\r\n"
    for head in (
        f"GET / HTTP/1.1\r\nHost: {host}\r\nHost: evil.com\r\n",
        "GET / HTTP/1.1\r\n",
        f"GET http://evil.com/ HTTP/1.1\r\nHost: {host}\r\n",
        f"GET http://{host}/ HTTP/1.1\r\nHost: {host}\r\n",
        f"GET *  HTTP/1.1\r\nHost: {host}\r\n",
    ):
        answer = raw(server.port, (head + tail).encode())
        assert answer.split(b" ")[1] in (b"400", b"421"), (head, answer[:100])


def test_another_computer_only_by_the_address_it_reached() -> None:
    for remote in (False, True):
        known = names(8000, ["box"], remote)
        assert known.host("box:8000", "10.0.0.5")
        assert known.host("10.0.0.5:8000", "10.0.0.5") is remote
        assert not known.host("10.0.0.6:8000", "10.0.0.5")
        assert not known.origin("http://10.0.0.5:8000.evil.com", "10.0.0.5")
    assert is_loopback("127.0.0.1")
    assert is_loopback("::1")
    assert is_loopback("::ffff:127.0.0.1")
    assert not is_loopback("10.0.0.5")
    assert not is_loopback("localhost.evil.com")


# W4


def test_nothing_that_is_got_changes_anything(folder: Path) -> None:
    with serving(folder) as server, Browser(server) as one, server.http(one.cookie) as http:
        scan = one.hello["scans"][0]["scan"]
        one.open(scan)
        device = "sim:sphere?seed=3&speckle=no"
        one.ask("connect", camera=device, turntable=device, lasers=device)
        before = _state(server, scan, folder)
        for method, path in HTTP:
            if method == "GET":
                for query in ("", "?on=1&lit=right", "?name=x&delete=1", "?faces=10"):
                    http.get(path.replace("abcdefgh", scan) + query)
        assert _state(server, scan, folder) == before


def _state(server: Running, scan: str, folder: Path) -> tuple[Any, ...]:
    opened = server.workshop.opened(scan)
    bench = server.workshop.rig.connected
    world = bench.hardware.turntable._world  # type: ignore[attr-defined]
    return (
        opened.now.document.body.digest(),
        opened.now.revision,
        opened.session.scan.edits(),
        sorted(p.name for p in folder.glob("*.turnscan")),
        (world.moves, world.commanded, world.lit),
        len(server.workshop.jobs._jobs),
    )


# W5


@pytest.mark.parametrize("place", PLACES)
def test_no_path_leads_out(locked: Locked, place: str) -> None:
    server, cookie = locked
    for pattern in ("/{}", "/api/{}", "/api/scans/{}/mesh", "/api/scans/{}/picture/0/0.png",
                    "/api/scans/abcdefgh/{}", "/api/downloads/{}", "/assets/{}"):  # fmt: skip
        answer = raw(
            server.port,
            f"GET {pattern.replace('{}', place)} HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
            f"Cookie: {cookie}\r\nConnection: close\r\n\r\n".encode(),
        )
        status = answer.split(b" ")[1] if answer else b""
        assert status in (b"404", b"400", b"200"), (pattern, answer[:200])
        assert b"root:" not in answer
        assert b"from __future__" not in answer
        assert b"Traceback" not in answer
        if status == b"200":  # the page itself, by another spelling of /
            assert b"<html" in answer[:2000].lower()


@pytest.mark.parametrize(
    "asked",
    [
        "; rm -rf /", "$(id)", "`id`", "con", "NUL.txt", "a\u202egnp.exe", "x" * 4096, "🦔🦔",
        "../../up", "/etc/passwd", "C:\\Windows", "a/b", "a\\b", ".hidden", "-rf", "a\0b", "name.",
    ],
)  # fmt: skip
def test_a_typed_name_is_never_a_path(tmp_path: Path, asked: str) -> None:
    library = Library(tmp_path)
    try:
        path = library.new_path(asked)
    except InputError:
        return
    assert path.parent == tmp_path.resolve()
    assert path.name == safe_name(asked) + ".turnscan"
    assert len(path.name.encode()) <= 220
    assert not path.name.startswith(".")
    assert path.stem.lower() not in ("con", "nul", "nul.txt")
    path.touch()
    assert [p.parent for p in library.paths().values()] == [tmp_path.resolve()]


def test_links_in_the_folder_are_not_followed(tmp_path: Path, scan_bytes: bytes) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "secret.turnscan").write_bytes(scan_bytes)
    (tmp_path / "in" / "link.turnscan").symlink_to(tmp_path / "secret.turnscan")
    assert Library(tmp_path / "in").paths() == {}


# W6


def test_what_is_too_large_is_refused_soon(locked: Locked, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_request_guard, "BODY_SECONDS", 1.0)
    server, cookie = locked
    head = (
        f"Host: 127.0.0.1:{server.port}\r\nOrigin: {server.base}\r\nX-Turnscan: 1\r\n"
        f"Cookie: {cookie}\r\n"
    )
    for text in (
        f"GET /{'a' * 5000} HTTP/1.1\r\n{head}\r\n",
        f"GET / HTTP/1.1\r\n{head}X: {'a' * 20000}\r\n\r\n",
        f"POST /api/invitations HTTP/1.1\r\n{head}Content-Length: -5\r\n\r\n",
        f"POST /api/scans?name=x HTTP/1.1\r\n{head}Content-Length: 99999999999\r\n\r\nabc",
        f"POST /login HTTP/1.1\r\n{head}Content-Length: 2000000\r\n\r\n{'a' * 1100000}",
        f"POST /login HTTP/1.1\r\n{head}Transfer-Encoding: chunked\r\n\r\n"
        + "10000\r\n"
        + "a" * 65536
        + "\r\n",
        f"POST /login HTTP/1.1\r\n{head}Content-Length: 30\r\n\r\n" + '{"token":',
    ):
        if "chunked" in text:
            text += ("10000\r\n" + "a" * 65536 + "\r\n") * 17
        began = time.monotonic()
        answer = raw(server.port, text.encode())
        assert answer.split(b" ")[1][:1] == b"4", (text[:60], answer[:200])
        assert time.monotonic() - began < 30
    token = _request("POST",
        f"{server.base}/login", content=b"\x1f\x8b" + bytes(100),
        headers={"Origin": server.base, "X-Turnscan": "1", "Content-Encoding": "gzip"},
    )  # fmt: skip
    assert token.status_code == 400


# W7


def test_connections_that_never_ask_are_hung_up_on(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_server, "HEADER_SECONDS", 2.0)
    with serving(folder) as server, contextlib.ExitStack() as stack:
        lazy = [
            stack.enter_context(socket.create_connection(("127.0.0.1", server.port), timeout=20))
            for _ in range(200)
        ]
        for link in lazy:
            link.sendall(b"GET / HTTP/1.1\r\nHost: ")
        assert _request("GET", f"{server.base}/login").status_code == 200
        assert [link.recv(1) for link in lazy] == [b""] * 200
        assert _request("GET", f"{server.base}/login").status_code == 200


# W8


@pytest.mark.parametrize(
    ("message", "code"),
    [
        ("not json", 1003),
        ("[]", 1003),
        ("3", 1003),
        ("[" * 100000, 1003),
        ('{"a":' * 1000 + "1" + "}" * 1000, 1003),
        ('{"kind":"turn","id":1,"angle_deg":NaN}', 1003),
        ('{"kind":"turn","kind":"stop","id":1}', 1003),
        (b"\xff" * 100, 1003),
        (b"\x02\x00\x00\x00{}", 1008),
        ('{"kind":"fire","id":1}', 1008),
        ('{"kind":"undo","id":1}', 1008),
        ('{"kind":"undo","id":1,"scan":"abcdefgh","more":1}', 1008),
        ('{"kind":"undo","id":1,"scan":"../../x"}', 1008),
        ('{"kind":"turn","id":1,"angle_deg":1e999}', 1008),
        ("a" * (4 * 2**20 + 1), 1009),
    ],
)
def test_a_message_that_is_none_ends_the_socket(
    locked: Locked, message: str | bytes, code: int
) -> None:
    server, cookie = locked
    with Browser(server, cookie) as one:
        said = _close_code(one, [message])
    # Of what is too long the rest is not read, and a reset may come before the word of it.
    assert said == code or (code == 1009 and said is None)


def test_what_a_person_typed_wrong_is_refused_in_a_sentence(locked: Locked) -> None:
    server, cookie = locked
    with Browser(server, cookie) as one:
        empty = one.ask("connect", camera="", turntable="sim:", lasers="sim:", rig=None)
        assert (empty["kind"], empty["code"]) == ("refused", "bad-request")
        assert empty["text"] == "camera: may not be empty"
        far = one.ask("turn", angle_deg=1e9)
        assert far["text"].startswith("angle_deg: must be at most ")
        assert one.ask("find_devices")["kind"] in ("found", "refused"), "still connected"


def test_a_flood_of_messages_ends_the_socket_and_nothing_else(locked: Locked) -> None:
    server, cookie = locked
    with Browser(server, cookie) as calm:
        with Browser(server, cookie) as flood:
            # Unread messages may turn the end into a reset, which has no code.
            assert _close_code(flood, ['{"kind":"ack","number":1}'] * 2000) in (1008, None)
        assert calm.ask("find_devices")["kind"] in ("found", "refused")


def test_there_are_eight_browsers_at_most(locked: Locked) -> None:
    server, cookie = locked
    with contextlib.ExitStack() as stack:
        for _ in range(8):
            stack.enter_context(Browser(server, cookie))
        with pytest.raises(ConnectionClosed):
            Browser(server, cookie)


# W10


def test_wrong_tokens_have_to_wait(folder: Path) -> None:
    with serving(folder) as server:
        headers = {"Origin": server.base, "X-Turnscan": "1"}
        said = [
            _request("POST", f"{server.base}/login", json={"token": f"wrong{k}"}, headers=headers)
            for k in range(FAILURES + 1)
        ]
        assert [a.status_code for a in said] == [401] * FAILURES + [429]
        assert int(said[-1].headers["retry-after"]) > 0
        good = _request(
            "POST", f"{server.base}/login", json={"token": server.keys.invite()}, headers=headers
        )
        assert good.status_code == 429


def test_the_wait_grows_and_is_forgotten() -> None:
    now = [0.0]
    keys = Keys(lambda: now[0])
    for _ in range(FAILURES):
        assert keys.wait("a") == 0
        keys.enter("wrong", "a")
    first = keys.wait("a")
    assert first > 0
    assert keys.wait("b") == 0
    now[0] += first
    keys.enter("wrong", "a")
    assert keys.wait("a") > first
    now[0] += 1000
    assert keys.wait("a") == 0
    assert keys.enter(keys.invite(), "a")


# W11, W12, W13, W17, W18, W20


@pytest.mark.parametrize(("method", "path"), HTTP)
def test_every_answer_has_the_headers(locked: Locked, method: str, path: str) -> None:
    server, cookie = locked
    for own in (cookie, "x=y"):
        if path == "/api/logout" and own is cookie:
            continue
        answer = _request(
            method, server.base + path,
            headers={"Origin": server.base, "X-Turnscan": "1", "Cookie": own},
        )  # fmt: skip
        policy = answer.headers["content-security-policy"]
        assert "default-src 'self'" in policy
        assert "frame-ancestors 'none'" in policy
        assert "script-src" not in policy  # so scripts are ours alone: no inline, no eval
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"
        assert not [h for h in answer.headers if h.startswith("access-control-")]
        assert "server" not in answer.headers


def test_forwarded_headers_make_nobody_local(locked: Locked) -> None:
    server, cookie = locked
    for header in ("X-Forwarded-For", "X-Real-IP", "Forwarded", "X-Forwarded-Host"):
        answer = _request("GET", f"{server.base}/api/scans/x/mesh", headers={header: "127.0.0.1"})
        assert answer.status_code == 401
        evil = _request(
            "GET",
            f"{server.base}/login",
            headers={"Host": "evil.com", header: f"127.0.0.1:{server.port}"},
        )
        assert evil.status_code == 421
    assert cookie


def test_the_cookie_is_for_this_server_alone(locked: Locked) -> None:
    server, _ = locked
    answer = _request(
        "POST",
        f"{server.base}/login",
        json={"token": server.keys.invite()},
        headers={"Origin": server.base, "X-Turnscan": "1"},
    )
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert f"turnscan-{server.port}=" in cookie
    page = _request("GET", f"{server.base}/login").text
    script = _request("GET", f"{server.base}/login.js").text
    assert "replaceState" in script
    assert "innerHTML" not in page + script
    assert 'location.replace("/")' in script


def test_a_route_is_locked_by_birth(folder: Path) -> None:
    """What is put behind the doors has no say in it."""

    async def leak(scope: Any, receive: Any, send: Any) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"secret"})

    import asyncio

    doors = Doors(leak, keys=Keys(), names=names(80), uploads=frozenset(), hide=str)
    sent: list[dict[str, Any]] = []

    async def ask(path: str) -> None:
        async def receive() -> dict[str, Any]:
            return {"type": "http.request", "body": b"", "more_body": False}

        async def send(message: Any) -> None:
            sent.append(message)

        scope = {
            "type": "http", "method": "GET", "path": path, "raw_path": path.encode(),
            "headers": [(b"host", b"127.0.0.1:80")], "query_string": b"", "server": ("", 80),
        }  # fmt: skip
        await doors(scope, receive, send)

    asyncio.run(ask("/anything/new"))
    assert sent[0]["status"] == 401
    assert b"secret" not in b"".join(m.get("body", b"") for m in sent)


def test_a_mistake_tells_and_logs_nothing(
    locked: Locked, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    server, cookie = locked

    def fail(*_: object) -> None:
        raise ZeroDivisionError("secret /srv/path")

    monkeypatch.setattr(server.workshop, "opened", fail)
    answer = _request("GET", f"{server.base}/api/scans/abcdefgh/mesh", headers={"Cookie": cookie})
    assert answer.status_code == 500
    assert "secret" not in answer.text
    with Browser(server, cookie) as one:
        one.ask("take_control")
        refused = one.ask("undo", scan="abcdefgh")
        assert refused["code"] == "mistake"
        assert "secret" not in json.dumps(refused)
    text = caplog.text
    assert "ZeroDivisionError" in text
    assert "secret" not in text
    assert "Traceback" not in text
    assert cookie.split("=")[1] not in text


_CLIENT = httpx.Client(timeout=PATIENCE)


def _request(method: str, url: str, **more: Any) -> httpx.Response:
    """A request with the cookies it is given and no others."""
    _CLIENT.cookies.clear()
    return _CLIENT.request(method, url, **more)


def _close_code(browser: Browser, messages: list[str | bytes]) -> int | None:
    """Send these; the code with which the server hangs up, None for a reset."""
    try:
        for message in messages:
            browser.socket.send(message)
        while True:
            browser.receive()
    except ConnectionClosed as e:
        return None if e.rcvd is None else e.rcvd.code


def _refused(server: Running, path: str, origin: str | None, headers: dict[str, str]) -> int | None:
    """The status a handshake is refused with; None where it is not."""
    try:
        with connect(
            f"ws://127.0.0.1:{server.port}{path}",
            origin=origin,
            additional_headers=headers,  # type: ignore[arg-type]
        ):
            return None
    except InvalidStatus as e:
        return int(e.response.status_code)
