"""The command line. Each verb lives in its own module and is imported only when it is used."""

from __future__ import annotations

import importlib
import os
import sys

import click

from turnscan import __version__
from turnscan.errors import TurnscanError

_VERBS = {
    "app": "the workshop in a browser: scan, see, mend, measure, export",
    "artefact": "targets and bodies to print, and the file of what is measured on them",
    "calibrate": "pictures of boards and of the empty table → rig.json with its uncertainty",
    "capture": "pictures of a board with what is connected, for calibrate",
    "check": "is a scan file whole, and what is in it?",
    "compare": "how far a measured mesh lies from a reference, and how much of it was measured",
    "demo": "scan a part that isn't there, and write it as DXF, STL and a report",
    "design": "resolution, working volume and limits of a rig before it is built",
    "devices": "serial ports and cameras that are connected",
    "doctor": "are camera, lasers and table ready for a scan?",
    "emulate": "a board on a serial port and a camera on the network that aren't there",
    "edit": "mend one scan in a browser",
    "edits": "the repairs kept in a scan file: list, switch, copy",
    "export": "a mesh file → DXF, STL, PLY, OBJ or XYZ",
    "import": "pictures made elsewhere → a scan file",
    "join": "several poses of one part → one surface",
    "measure": "flat sides, angles, spheres and cylinders of a measured part",
    "reconstruct": "a scan file → points, mesh, CAD",
    "resume": "take what an interrupted scan is missing",
    "scan": "a turn of the table with the devices that are connected → a scan file",
    "section": "planes through a part → a drawing of lines and arcs: DXF, SVG, PDF",
    "simulate": "pictures or a scan file of a part that isn't there",
    "verify": "scans of a measured artefact: is the scanner still what it was?",
}


class _Verbs(click.Group):
    """Verbs by name; the module ``turnscan.cli._NAME`` holds the click command ``verb``."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(_VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _VERBS:
            return None
        command = importlib.import_module(f"turnscan.cli._{cmd_name}").verb
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Verbs"):
            formatter.write_dl(sorted(_VERBS.items()))


@click.group(cls=_Verbs, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="turnscan")
def turnscan() -> None:
    """Laser-line turntable 3-D scanning: pictures in, calibrated mesh and DXF out."""


def main() -> None:
    """Run the command line; every foreseen error is one line on stderr and an exit code."""
    try:
        turnscan.main(prog_name="turnscan", standalone_mode=False)
    except click.exceptions.Abort:
        _fail("interrupted", 130)
    except click.UsageError as e:
        where = e.ctx.command_path if e.ctx is not None else "turnscan"
        _fail(f"{' '.join(e.format_message().split())} → see `{where} --help`", e.exit_code)
    except click.ClickException as e:
        _fail(" ".join(e.format_message().split()), e.exit_code)
    except click.exceptions.Exit as e:
        sys.exit(e.exit_code)
    except TurnscanError as e:
        from turnscan.cli._words import error_line

        _fail(error_line(e), e.exit_code)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(0)
    except MemoryError:
        _fail("out of memory → use a smaller scan or a coarser spacing", 2)
    except OSError as e:
        what = f"{e.filename}: {e.strerror}" if e.filename else str(e)
        _fail(f"{what} → check the path, its permissions and the free space", 5)
    except Exception as e:  # the door: whatever is left is our mistake
        if os.environ.get("TURNSCAN_TRACEBACK"):
            raise
        _fail(
            f"a mistake inside turnscan ({type(e).__name__}: {' '.join(str(e).split())}) → "
            "please report it with the output of the same command under TURNSCAN_TRACEBACK=1",
            1,
        )


def _fail(text: str, code: int) -> None:
    click.echo(f"turnscan: {text}", err=True)
    sys.exit(code)
