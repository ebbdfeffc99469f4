"""Which tests should notice a fault in which room, the quickest first."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatch

_SMALL = "not any_picture and not turned and not moves and not more_light"
"""What the interpreter does in a second or two."""
_SHORT = (
    "garbage_on or refuses_a_long or frames or first_bytes or lease_lasts or ran_out or opens or "
    "share_its_port or terminated or no_lease_and or signs_of_life or waits_for or power_out or "
    "passes or no_hold"
)
"""What judges the guard in half a minute."""
_JUDGED = "goes_on or can_reach or repaired or same_seed"
"""What the judge says in seconds of its own time; its 8 000 transitions take longer, and where it
finds defects it puts them in the place of texts that a mutant may have changed."""
_SEEN = ("calibrate/_light.py", "calibrate/_select.py")


@dataclass(frozen=True)
class Suite:
    """Tests that run together."""

    tests: tuple[str, ...]
    """Files from ``tests``, and pytest's options that choose among theirs."""
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
        ("devices/_guard.py", "devices/_guard_client.py", "devices/_lit.py"),
        (
            Suite(("safety/test_state_machine.py", "-k", _JUDGED)),
            Suite(("safety/test_guard.py", "safety/test_lines.py", "-k", _SHORT)),
            Suite(("safety/test_guard.py", "-k", "off_always or nobody_confirms")),
        ),
        28,
    ),
    "stripes": Room(
        ("stripes/_*.py",),
        (
            Suite(
                ("stripes/test_detect.py", "-k", _SMALL), compiled=False, only=("stripes/_[!bf]*",)
            ),
            Suite(("stripes/test_fuse.py",), only=("stripes/_fuse*",)),
            Suite(("points/test_sweep.py", "-k", "piece_of_light"), only=("stripes/_light.py",)),
            Suite(("stripes/test_colour_background.py",), only=("stripes/_[bc]*",)),
            Suite(("stripes/test_sigma.py", "stripes/test_detect.py", "stripes/test_signal.py")),
            Suite(("stripes/test_accuracy.py", "-k", "not speckle_is_averaged")),
        ),
        28,
    ),
    "points": Room(
        ("points/_*.py",),
        (
            Suite(("points/test_range_scan.py",), only=("points/_range*", "points/_placements*")),
            Suite(("points/test_sweep.py",), only=("points/_sweep*",)),
            Suite(("points/test_wholeness.py",), only=("points/_wholeness*", "points/_build.py")),
            Suite(("points/test_grid.py", "points/test_triangulate.py")),
        ),
        28,
    ),
    "calibrate": Room(
        ("calibrate/_*.py",),
        (
            Suite(("calibrate/test_boards.py",), only=("calibrate/_[abmp]*", *_SEEN)),
            Suite(("calibrate/test_steps.py",), only=("calibrate/_steps.py",)),
            Suite(("calibrate/test_board_on_table.py", "calibrate/test_honest.py")),
            Suite(("calibrate/test_network.py", "-k", "not claimed_uncertainty")),
            Suite(("calibrate/test_cli.py",), only=("calibrate/_[efp]*", "calibrate/_stages*")),
        ),
        28,
    ),
    "shapes": Room(
        ("shapes/_*.py",),
        (
            Suite(("shapes/test_planes.py", "-k", "not 0.2"), only=("shapes/_plane*",)),
            Suite(("shapes/test_volume.py",), only=("shapes/_[asv]*",)),
            Suite(("shapes/test_fit.py", "shapes/test_deviation.py", "shapes/test_measure.py")),
        ),
        28,
    ),
    "surface": Room(
        ("surface/_*.py", "surface/*/_*.py"),
        (
            Suite(("surface/test_tsdf.py", "-k", "squares"), only=("surface/fusion/_tsdf*",)),
            Suite(("surface/test_tsdf.py", "-k", "anyhow"), True, ("*/_vertex_sigma.py",)),
            Suite(("surface/test_decimate.py", "-k", "dissolved"), True, ("*/_decimate.py",)),
            Suite(
                ("surface/test_merge_truth.py", "-k", "own_point or beside or looked"),
                only=("*/_range_surface.py", "*/_carve.py"),
            ),
            Suite(("surface/test_fill.py", "-k", "steeper"), only=("surface/holes/_fill.py",)),
            Suite(("surface/test_denoise.py", "-k", "believed"), only=("surface/_noise.py",)),
        ),
        0,
    ),
    "edit": Room(("edit/_*.py",), (Suite(("edit/test_measures.py", "edit/test_holes.py")),), 0),
    "rig": Room(("rig/_*.py",), (Suite(("rig/test_pose_sheet_rig.py",)),), 0),
}  # fmt: skip
