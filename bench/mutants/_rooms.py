"""Which tests should notice a fault in which room, the quickest first."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatch


@dataclass(frozen=True)
class Suite:
    """Tests that run together."""

    tests: tuple[str, ...]
    """Files or single tests, from ``tests``."""
    compiled: bool = True
    """False where the kernels run as plain Python: the tests are small, compiling is not."""
    only: tuple[str, ...] = ("*",)
    """Modules of the room that it is about (patterns)."""


@dataclass(frozen=True)
class Room:
    """Modules, and the tests that cover them."""

    modules: tuple[str, ...]
    """Patterns of files, from ``src/turnscan``."""
    suites: tuple[Suite, ...]
    sample: int
    """Mutants that are drawn; those written by hand come on top."""

    def suites_of(self, path: str) -> list[Suite]:
        """Those that are about one file."""
        return [s for s in self.suites if any(fnmatch(path, only) for only in s.only)]


ROOMS = {
    "safety": Room(
        ("devices/_guard.py", "devices/_link.py", "devices/_lit.py"),
        (Suite(("safety/test_guard.py",)),),
        32,
    ),
    "stripes": Room(
        ("stripes/_*.py",),
        (
            Suite(
                ("stripes/test_detect.py", "-k", "not any_picture and not turned and not moves"),
                compiled=False, only=("stripes/_[!bf]*.py",),
            ),
            Suite(("stripes/test_fuse.py",), only=("stripes/_fuse*.py",)),
            Suite(("stripes/test_colour_background.py",), only=("stripes/_[bc]*.py",)),
            Suite(("stripes/test_signal.py", "stripes/test_detect.py")),
            Suite(("stripes/test_sigma.py", "stripes/test_accuracy.py")),
        ),
        32,
    ),
    "points": Room(
        ("points/_*.py",),
        (
            Suite(("points/test_range_scan.py",), only=("points/_range*.py", "points/_pl*.py")),
            Suite(("points/test_between.py", "points/test_grid.py", "points/test_triangulate.py")),
        ),
        32,
    ),
    "calibrate": Room(
        ("calibrate/_*.py",),
        (
            Suite(("calibrate/test_boards.py",), only=("calibrate/_[abeilmp]*.py",)),
            Suite(("calibrate/test_steps.py",), only=("calibrate/_steps.py",)),
            Suite(("calibrate/test_honest.py", "calibrate/test_board_on_table.py")),
            Suite(("calibrate/test_network.py",)),
            Suite(("calibrate/test_boards.py", "calibrate/test_cli.py")),
        ),
        32,
    ),
    "shapes": Room(
        ("shapes/_*.py",),
        (
            Suite(("shapes/test_fit.py", "shapes/test_deviation.py", "shapes/test_measure.py")),
            Suite(("shapes/test_volume.py",), only=("shapes/_[sv]*.py", "shapes/_measure.py")),
            Suite(("shapes/test_planes.py",), only=("shapes/_plane*.py", "shapes/_f*.py")),
        ),
        32,
    ),
    "surface": Room(
        ("surface/_*.py",),
        (
            Suite(("surface/test_tsdf.py",), only=("surface/_tsdf*.py",)),
            Suite(("surface/test_fill.py",), only=("surface/_fill.py",)),
            Suite(("surface/test_denoise.py",), only=("surface/_noise.py",)),
        ),
        0,
    ),
    "edit": Room(("edit/_*.py",), (Suite(("edit/test_measures.py", "edit/test_holes.py")),), 0),
    "rig": Room(("rig/_*.py",), (Suite(("rig/test_pose_sheet_rig.py",)),), 0),
}  # fmt: skip
