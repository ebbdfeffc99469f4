"""A process that forks servers of the browser workshop, to be killed.

Started as ``python -m tests.crash.edit_server FOLDER``; for each line on stdin it forks a server
for the scans of FOLDER and writes one JSON line: its process, its port and a token.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

from turnscan.app import Library, Workshop
from turnscan.app._auth import Keys
from turnscan.app._hub import Hub
from turnscan.app._jobs import Job
from turnscan.app._open_scan import OpenScan
from turnscan.app._server import Listening, Server, application, bind
from turnscan.app._step_pictures import StepPictures


def warm(folder: Path) -> None:
    """Open a copy of each scan once, so that the children find everything loaded."""
    with tempfile.TemporaryDirectory() as elsewhere:
        pictures = StepPictures(Path(elsewhere))
        for path in folder.glob("*.turnscan"):
            copy = Path(elsewhere) / path.name
            shutil.copy(path, copy)
            hub = Hub()
            OpenScan("warm", copy, hub, Job(hub, "open", "", None), pictures).close()
        pictures.close()


def serve(folder: Path, told: int) -> None:
    """Be a server, until somebody kills it."""
    workshop, keys = Workshop(Library(folder)), Keys()
    listener = bind(Listening())
    port = int(listener.getsockname()[1])

    def listening() -> None:
        answer: dict[str, Any] = {"pid": os.getpid(), "port": port, "token": keys.invite()}
        os.write(told, json.dumps(answer).encode() + b"\n")

    Server(application(workshop, keys, port), listening).run([listener])


def main() -> None:
    """Fork a server for each line."""
    folder = Path(sys.argv[1])
    warm(folder)
    for _ in sys.stdin:
        pid = os.fork()
        if pid == 0:
            try:
                serve(folder, 1)
            finally:
                os._exit(0)
        os.waitpid(pid, 0)
        os.write(1, b"gone\n")


if __name__ == "__main__":
    main()
