"""``turnscan devices``: what is connected?"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict

import click

from turnscan.devices import camera_schemes, find_cameras, list_ports, probe_port
from turnscan.findings import findings_json


@click.command("devices")
@click.argument("ports", nargs=-1, metavar="[PORT]…")
@click.option("--probe", is_flag=True, help="Open the ports and ask which board is behind them.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
def verb(ports: tuple[str, ...], probe: bool, as_json: bool) -> None:
    """List serial ports and cameras. Nothing moves and nothing is lit.

    Without --probe no port is opened. With it, or with PORTs named, each is asked in the four
    languages turnscan knows; only words for dark and questions are sent. Exit code 1 when a named
    PORT does not answer.
    """
    listed = list_ports()
    asked = list(ports) or ([p.path for p in listed] if probe else [])
    answers = [probe_port(path) for path in asked]
    cameras, findings = find_cameras()
    if as_json:
        report = {
            "ports": [asdict(p) for p in listed],
            "boards": [asdict(a) for a in answers],
            "cameras": cameras,
            "camera_schemes": camera_schemes(),
            "findings": json.loads(findings_json(findings)),
        }
        click.echo(json.dumps(report, indent=1))
    else:
        for port in listed:
            click.echo(f"port {port.path}: {port.description}")
        for answer in answers:
            click.echo(f"{answer.path}: {answer.address or f'no board ({answer.why_not})'}")
        for camera in cameras:
            click.echo(f"camera {camera}")
        for finding in findings:
            click.echo(str(finding))
        if not listed and not asked:
            click.echo("no serial port")
        if not cameras:
            click.echo("no camera")
        if listed and not asked:
            click.echo("turnscan devices --probe asks which boards are behind the ports")
    if ports and not all(a.address for a in answers):
        sys.exit(1)
