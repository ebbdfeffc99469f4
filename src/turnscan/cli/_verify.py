"""``turnscan verify``: test the scanner with scans of a measured artefact."""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._progress import progress_bar
from turnscan.errors import InputError

_path = click.Path(path_type=Path)


@click.command("verify")
@click.argument("scans", nargs=-1, required=True, type=_path, metavar="SCAN...")
@click.option("--artefact", required=True, type=_path,
              help="Artefact file with its measured values, TOML or JSON.")  # fmt: skip
@click.option("--rig", "rig_path", type=_path, help="rig.json.  [default: from each scan]")
@flags_of(workflows.VerifyOptions)
@click.option("--history", type=_path,
              help="History (SQLite file) to which the run is added; created if new.")  # fmt: skip
@click.option("--date", type=click.DateTime(["%Y-%m-%d", "%Y-%m-%dT%H:%M"]),
              help="Date of the scans, UTC.  [default: now]")  # fmt: skip
@click.option("--report", "reports", multiple=True, type=_path,
              help="Report to write, .html or .json.")  # fmt: skip
@click.option("--trend", type=_path, help="Chart of the history to write, .png; needs --history.")
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON.")
def verb(
    scans: tuple[Path, ...],
    artefact: Path,
    rig_path: Path | None,
    history: Path | None,
    date: datetime | None,
    reports: tuple[Path, ...],
    trend: Path | None,
    options: workflows.VerifyOptions,
    as_json: bool,
) -> None:
    """Test the scanner with SCANs of a sphere, ball bar, plate or step block (turnscan artefact).

    Each SCAN is a scan file or a mesh made from one; several, in the order of time, also give the
    repeatability. Exit code 1 where a value exceeds its limit or the history shows a drift. The
    values are defined in the documentation; they are no statement of conformity to a standard.
    """
    inputs = [*scans, artefact, *([rig_path] if rig_path else [])]
    if trend is not None and history is None:
        raise InputError(f"{trend}: a trend chart needs a history", hint="give --history FILE")
    outputs = [*reports, *(p for p in (trend, history) if p is not None)]
    workflows.check_apart(outputs)
    for path in reports:
        workflows.check_output(path, (".html", ".json"), inputs)
    if trend is not None:
        workflows.check_output(trend, (".png",), inputs)
    if history is not None:
        workflows.check_output(history, (), inputs)
    when = date.replace(tzinfo=UTC) if date is not None else datetime.now(UTC)
    with progress_bar() as bar:
        done = workflows.verify(
            scans,
            artefact,
            time=when.timestamp(),
            rig=None if rig_path is None else workflows.read_rig_file(rig_path),
            limits=options.by_test,
            history=history,
            progress=bar,
        )
    for path in reports:
        html = path.suffix.lower() == ".html"
        text = workflows.verification_html(done) if html else workflows.verification_json(done)
        workflows.write_atomically(path, text.encode())
    if trend is not None:
        workflows.write_atomically(trend, workflows.trend_picture(done))
    text = "\n".join(workflows.verification_lines(done))
    click.echo(workflows.verification_json(done) if as_json else text)
    if not done.passed:
        sys.exit(1)
