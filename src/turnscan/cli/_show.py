"""Showing what became of a scan: findings, files, summary, report."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._progress import progress_bar
from turnscan.cli._words import with_flags


def show_result(
    result: workflows.ReconstructResult,
    outputs: Sequence[Path],
    reports: Sequence[Path],
    formats: workflows.ExportOptions,
) -> None:
    """Print what was found, write the outputs and the reports; exit code 1 where one is an error.

    An error among the findings leaves only the reports to be written.
    """
    for finding in result.findings:
        click.echo(with_flags(finding), err=True)
    if not result.failed:
        with progress_bar() as progress:
            remarks = result.save(*outputs, options=formats, progress=progress)
        for remark in remarks:
            click.echo(with_flags(remark), err=True)
    for line in result.summary():
        click.echo(line)
    for report in reports:
        result.save_report(report)
    if result.failed:
        sys.exit(1)
    for path in outputs:
        click.echo(f"{path}: {path.stat().st_size / 1e6:.2f} MB, read back the same")
