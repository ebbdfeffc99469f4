"""A small scan of a can, whose pictures are drawn, not simulated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image as Pillow

from tests.analytic import Shape, cylinder, full_turn, make_rig, scan_shape
from turnscan.rig import Rig, rig_to_json
from turnscan.scan import Frame, Scan, ScanPlan

STEPS = 24


CAN_RIG = make_rig(elevation=0.1, lift=20.0)
CAN = cylinder(25, 0, 40)


def write_can(path: Path, stored: Rig = CAN_RIG, rig: Rig = CAN_RIG, shape: Shape = CAN) -> Path:
    """Write a scan of a can of radius 25 mm and 40 mm height, or of another shape, with noise, rig
    and angles.

    The file says that the rig ``stored`` took it, in truth it was ``rig``.
    """
    u, rng = np.arange(320), np.random.default_rng(3)
    with Scan.create(path, ScanPlan(320, 240, "uint8", 1, ("L0",), STEPS, 12.0), stored) as scan:
        for k, s in enumerate(scan_shape(rig, shape, full_turn(STEPS))):
            at = np.nan_to_num(s.position, nan=-1e3)[:, None]
            light = 180 * np.exp(-0.5 * ((u - at) / 1.5) ** 2) + rng.normal(12, 1.0, (240, 320))
            dark = rng.normal(12, 1.0, (240, 320))
            lit, off = (np.clip(np.rint(p), 0, 255).astype(np.uint8) for p in (light, dark))
            scan.add(Frame(k, "L0", lit, off, commanded=float(full_turn(STEPS)[k])))
    return path


def write_pictures(scan: Path, folder: Path) -> None:
    """The frames of a grey scan as pictures, with the laser on and off, and its rig."""
    (folder / "pictures").mkdir()
    (folder / "dark").mkdir()
    with Scan.open(scan) as opened:
        assert opened.rig is not None
        (folder / "rig.json").write_text(rig_to_json(opened.rig))
        for frame in opened.frames():
            assert frame.dark is not None
            name = f"step{frame.step:03d}.png"
            Pillow.fromarray(frame.lit).save(folder / "pictures" / name, compress_level=1)
            Pillow.fromarray(frame.dark).save(folder / "dark" / name, compress_level=1)
