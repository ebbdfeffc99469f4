"""Options of the browser workshop, and running it: what ``app`` and ``edit`` share."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., Any])


def serving_options(command: Command) -> Command:
    """Give a verb the options of the server; it receives them as ``serving``."""

    @click.option(
        "--port",
        type=click.IntRange(0, 65535),
        default=0,
        help="TCP port to listen on.  [default: a free one]",
    )
    @click.option(
        "--host", default="127.0.0.1", show_default=True, help="Network address to listen on."
    )
    @click.option("--no-browser", is_flag=True, help="Print the link without opening a browser.")
    @click.option("--allow-remote", is_flag=True, help="Accept connections from other computers.")
    @click.option(
        "--allow-remote-lasers",
        is_flag=True,
        help="Also allow other computers to light the lasers.",
    )
    @wraps(command)
    def with_options(
        *args: Any,
        port: int,
        host: str,
        no_browser: bool,
        allow_remote: bool,
        allow_remote_lasers: bool,
        **others: Any,
    ) -> Any:
        given = {
            "port": port,
            "host": host,
            "browser": not no_browser,
            "remote": allow_remote,
            "remote_lasers": allow_remote_lasers,
        }
        return command(*args, serving=given, **others)

    return with_options  # type: ignore[return-value]


def run(folder: Path, only: Path | None, serving: dict[str, Any]) -> None:
    """Serve until Ctrl-C. Raises InputError where the options contradict each other."""
    from turnscan.app import Library, Listening, Workshop, serve
    from turnscan.errors import InputError

    if serving["remote_lasers"] and not serving["remote"]:
        raise InputError("--allow-remote-lasers without --allow-remote", hint="give both")
    where = Listening(serving["host"], serving["port"], serving["remote"])
    workshop = Workshop(Library(folder, only), remote_lasers=serving["remote_lasers"])

    said: list[str] = []

    def say(link: str) -> None:
        click.echo(f"for another browser: {link}" if said else f"turnscan: {link}")
        if not said:
            click.echo("the link admits one browser; Ctrl-C ends the server", err=True)
        said.append(link)

    serve(workshop, where, say, serving["browser"])
