"""Large files in pieces: cut off, resumed, refused."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from tests.web.running import Browser, Running, serving
from tests.web.uploads import box
from turnscan.app import _uploads
from turnscan.formats import export


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("library")


@pytest.fixture(scope="module")
def server(place: Path) -> Iterator[Running]:
    with serving(place) as running:
        yield running


@pytest.fixture(scope="module")
def http(server: Running) -> Iterator[httpx.Client]:
    with Browser(server) as browser, server.http(browser.cookie) as client:
        yield client


def begin(http: httpx.Client, total: int) -> str:
    answer = http.post("/api/uploads", params={"bytes": total})
    assert answer.status_code == 201
    assert answer.json()["received"] == 0
    name: str = answer.json()["upload"]
    return name


def add(http: httpx.Client, upload: str, at: int, piece: bytes) -> httpx.Response:
    return http.post("/api/uploads", params={"upload": upload, "at": at}, content=piece)


def received(http: httpx.Client, upload: str) -> int:
    number: int = http.get(f"/api/uploads/{upload}").json()["received"]
    return number


def test_a_scan_arrives_in_pieces(http: httpx.Client, place: Path, scan_bytes: bytes) -> None:
    upload, half = begin(http, len(scan_bytes)), len(scan_bytes) // 2
    assert add(http, upload, 0, scan_bytes[:half]).json()["received"] == half
    answer = http.post("/api/scans", params={"name": "in pieces", "upload": upload})
    assert answer.status_code == 400
    assert f"{half} of" in answer.text
    assert add(http, upload, half, scan_bytes[half:]).json()["received"] == len(scan_bytes)
    answer = http.post("/api/scans", params={"name": "in pieces", "upload": upload})
    assert answer.status_code == 201, answer.text
    assert (place / "in pieces.turnscan").read_bytes() == scan_bytes
    assert http.get(f"/api/uploads/{upload}").status_code == 404, "it is done"


def test_a_piece_that_was_sent_before_is_not_taken_twice(http: httpx.Client) -> None:
    data = export(box(), ".stl")
    upload = begin(http, len(data))
    assert add(http, upload, 0, data[:100]).json()["received"] == 100
    for at in (0, 50, 300):
        assert add(http, upload, at, data[:100]).json()["received"] == 100
    assert add(http, upload, 100, data[100:]).json()["received"] == len(data)
    answer = http.post("/api/files", params={"name": "box.stl", "into": "", "upload": upload})
    (file,) = answer.json()["files"]
    assert http.get(f"/api/files/{file}").content == data


def test_what_arrived_before_the_connection_broke_stays(
    server: Running, http: httpx.Client
) -> None:
    data = bytes(range(256)) * 4000
    upload = begin(http, len(data))
    request = http.build_request(
        "POST", "/api/uploads", params={"upload": upload, "at": 0}, content=data
    )
    head = f"{request.method} {request.url.raw_path.decode()} HTTP/1.1\r\n"
    head += "".join(f"{k}: {v}\r\n" for k, v in request.headers.items()) + "\r\n"
    with socket.create_connection((request.url.host, request.url.port or 80)) as line:
        line.sendall(head.encode() + data[:300_000])
    # The next piece waits until the broken one is over.
    assert add(http, upload, 1, b"").json()["received"] <= 300_000
    here = received(http, upload)
    assert add(http, upload, here, data[here:]).json()["received"] == len(data)


def test_a_file_may_not_be_larger_than_it_said_nor_than_fits(http: httpx.Client) -> None:
    upload = begin(http, 10)
    answer = add(http, upload, 0, b"x" * 11)
    assert answer.status_code == 400
    assert "more than the 10 bytes" in answer.text
    answer = http.post("/api/uploads", params={"bytes": 2 << 30})
    assert answer.status_code == 400
    assert "at most 1 GB" in answer.text
    for params in (
        {"bytes": "-1"},
        {"upload": "nothing", "at": "0"},
        {"upload": upload, "at": "x"},
    ):
        assert http.post("/api/uploads", params=params).status_code == 400


def test_only_so_many_files_are_on_their_way(http: httpx.Client, place: Path) -> None:
    first = begin(http, 100)
    add(http, first, 0, b"abc")
    for _ in range(_uploads._MOST):
        last = begin(http, 100)
    assert http.get(f"/api/uploads/{first}").status_code == 404, "the one that waited longest goes"
    assert received(http, last) == 0
    kept = [p for p in place.rglob(".turnscan-incoming-*/.*") if p.name != ".lock"]
    assert len(kept) == _uploads._MOST, "and what it had sent goes with it"
