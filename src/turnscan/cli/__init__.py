"""The command line. Each verb lives in its own module and is imported only when it is used."""

from __future__ import annotations

import importlib
import os
import sys
from collections import Counter

import click

from turnscan import __version__
from turnscan.errors import TurnscanError
from turnscan.memory import seldom_look_for_garbage
from turnscan.threads import VARIABLE, single_threaded_algebra

_VERBS = {
    "app": "the workshop in a browser: scan, inspect, repair, measure, export",
    "artefact": "targets and artefacts to print, and the file for their measured values",
    "batch": "many scans by one recipe, on all processors or a cluster",
    "calibrate": "pictures of boards and of the empty table → rig.json with its uncertainty",
    "capture": "take pictures of a board for calibrate",
    "check": "contents and integrity of a scan file, soundness of a mesh",
    "compare": "deviation of a measured mesh from a reference, and its completeness",
    "demo": "scan a simulated part and write DXF, STL and a report",
    "design": "resolution, working volume and limits of a rig before it is built",
    "devices": "serial ports and cameras that are connected",
    "doctor": "check camera, lasers and turntable before a scan",
    "emulate": "emulated controller on a serial port, emulated camera on the network",
    "edit": "repair one scan in a browser",
    "edits": "the edits stored in a scan file: list, enable, copy",
    "export": "a mesh file or scan → DXF, STL, PLY, OBJ, 3MF, GLB or XYZ",
    "import": "pictures made elsewhere → a scan file",
    "join": "several poses of one part → one surface",
    "measure": "planar faces, angles, spheres and cylinders of a measured part",
    "precompile": "compile the kernels of a scan and its surface before the first one",
    "reconstruct": "a scan file → points, mesh, CAD",
    "refine": "improve a rig without a board, by a scan from two lasers or of a sphere",
    "resume": "complete an interrupted scan",
    "revolve": "axis, roundness and wall profile of a turned part → drawing, STEP",
    "scan": "a turn of the table with the devices that are connected → a scan file",
    "section": "planes through a part → a drawing of lines and arcs: DXF, SVG, PDF",
    "shapes": "planes, cylinders, spheres, cones and tori of a part, their sizes and relations",
    "simulate": "pictures or a scan file of a simulated part",
    "verify": "test the scanner with a measured artefact, and keep its history",
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

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The verb, unless a flag that counts once is given twice: the last would be taken, and the
        others dropped without a word."""
        name, command, rest = super().resolve_command(ctx, args)
        if command is not None:
            of_verb = click.Context(command, parent=ctx, info_name=name)
            order = command.make_parser(of_verb).parse_args(list(rest))[2]
            for flag, times in Counter(p for p in order if isinstance(p, click.Option)).items():
                if times > 1 and not (flag.multiple or flag.count or flag.is_flag):
                    text = f"{max(flag.opts, key=len)} is given {times} times; it counts once"
                    raise click.UsageError(text, of_verb)
        return name, command, rest

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Verbs"):
            formatter.write_dl(sorted(_VERBS.items()))


@click.group(cls=_Verbs, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="turnscan")
@click.option(
    "--jobs",
    type=click.IntRange(1),
    help="Number of threads; results do not depend on it.  [default: one per processor]",
)
def turnscan(jobs: int | None) -> None:
    """Laser-line turntable 3-D scanning: pictures in, calibrated mesh and DXF out."""
    if jobs is not None:
        os.environ[VARIABLE] = str(jobs)


def main() -> None:
    """Run the command line; every foreseen error is one line on stderr and an exit code."""
    single_threaded_algebra()
    seldom_look_for_garbage()
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
            f"internal error ({type(e).__name__}: {' '.join(str(e).split())}) → "
            "please report it with the output of the same command under TURNSCAN_TRACEBACK=1",
            1,
        )


def _fail(text: str, code: int) -> None:
    click.echo(f"turnscan: {text}", err=True)
    sys.exit(code)
