"""The driver of docs/how-to/add-a-driver.md is run as it stands there."""

from __future__ import annotations

import math
import re
import socket
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from turnscan.testing import check_turntable

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "add-a-driver.md"


class Server:
    """A table of 6400 steps behind TCP."""

    def __init__(self) -> None:
        self.step = 0
        self.socket = socket.create_server(("127.0.0.1", 0))
        self.port = self.socket.getsockname()[1]
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self) -> None:
        try:
            while True:
                link, _ = self.socket.accept()
                with link, link.makefile("r") as lines:
                    for line in lines:
                        self.step = int(line.split()[1])
                        link.sendall(f"at {self.step}\n".encode())
        except OSError:
            return

    def close(self) -> None:
        self.socket.shutdown(socket.SHUT_RDWR)
        self.socket.close()


@pytest.fixture
def server() -> Iterator[Server]:
    it = Server()
    yield it
    it.close()


def test_the_driver_of_the_page(server: Server) -> None:
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.S)
    assert blocks[0].count("\n") <= 60
    room: dict[str, Any] = {}
    exec(compile(blocks[0], str(PAGE), "exec"), room)
    check_turntable(
        lambda: closing(room["StepServerTable"](f"stepserver:127.0.0.1:{server.port}")),
        microstep=2 * math.pi / 6400,
        true_angle=lambda: 2 * math.pi * server.step / 6400,
    )
