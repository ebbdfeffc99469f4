"""Parts given by formulas, scanned in several poses."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from tests.analytic import box, cylinder, full_turn, make_rig, scan_shape, sphere, union, with_noise
from turnscan.points import RangeGrid, Volume, build_grid, clip, drop_specks
from turnscan.poses import View, view
from turnscan.rig import Pose, Rig, rotation_about
from turnscan.scan import Frame, Scan, ScanPlan
from turnscan.stripes import Stripe
from turnscan.surface.clean import clean
from turnscan.surface.fusion import range_surfaces

STEPS = 60
NOISE = 0.1
"""px"""
WALL = 4.0


def cup(P):
    """A hollow, slightly conical cup on z = 0, without a handle."""
    r, z = np.hypot(P[..., 0], P[..., 1]), P[..., 2]
    lean = 0.15
    side = (r - (24.0 + lean * z)) / np.hypot(1, lean)
    outer = np.maximum(side, np.maximum(-z, z - 60.0))
    inner = np.maximum(side + WALL, 5.0 - z)
    return np.maximum(outer, -inner)


knob = union(
    box((24, 15, 20), (2, 0, 20), 0.2), sphere(13.0, (14, 8, 42)), cylinder(9.0, 0.0, 52.0)
)
"""A part without symmetry."""
prism = box((20, 20, 28), (0, 0, 28), 0.0)
"""A square prism: its four sides are alike."""


def laid(angle: float, low: float, middle: float, spin: float = 0.0) -> Pose:
    """T_table_part of a part tipped about x, its own z first turned by ``spin``; set down."""
    R = rotation_about([1, 0, 0], angle) @ rotation_about([0, 0, 1], spin)
    return Pose(R, np.array([0.0, middle, low]))


BALLS = np.array([[32.0, 0, 30], [-26, 20, 22], [2, -24, 44], [-14, 12, 52]])
marked = union(knob, *(sphere(9.0, tuple(c)) for c in BALLS))
"""The part with balls of 18 mm on it."""
SHAPES = {"marked": marked, "cup": cup, "knob": knob, "prism": prism}
STANDS = {
    "marked": Pose(),
    "marked lying": laid(np.pi / 2, 36.0, 30.0, 0.4),
    "cup": Pose(),
    "knob": Pose(),
    "prism": Pose(),
    "cup lying": laid(np.pi / 2, 33.0, 30.0),
    "knob lying": laid(np.pi / 2, 25.0, 25.0, 0.4),
    "prism lying": laid(np.pi / 2, 20.0, 28.0),
}
"""T_table_part."""


def rig_for(name: str) -> Rig:
    """A camera that looks down on a part, but straight at the cup: its inside stays hidden."""
    return make_rig(lift=30.0, elevation=0.0 if name.startswith("cup") else 0.35)


@cache
def stripes(name: str) -> list[Stripe]:
    """Exact stripes of one turn of a part as it stands."""
    shape, back = SHAPES[name.split()[0]], STANDS[name].inverse()
    return scan_shape(rig_for(name), lambda P: shape(back.apply(P)), full_turn(STEPS), sigma=NOISE)


def grid(name: str, seed: int, low: float = 2.0, high: float = 200.0) -> RangeGrid:
    """The same with noise, as a cleaned grid of what lies between two heights."""
    noisy = with_noise(stripes(name), NOISE, seed)
    made = build_grid(rig_for(name), "L0", noisy, range(STEPS), full_turn(STEPS))
    return clean(drop_specks(clip(made, Volume(90.0, low, high)), 3))[0]


def seen(name: str, *grids: RangeGrid) -> View:
    """The view of a pose."""
    return view(name, [s for g in grids for s in range_surfaces(g)])


def truth(a: str, b: str) -> Pose:
    """Where b lies in the frame of a."""
    return STANDS[a] @ STANDS[b].inverse()


def apart(a: Pose, b: Pose, v: View) -> float:
    """mm rms between the points of a view in two poses."""
    return float(np.sqrt(((a.apply(v.points) - b.apply(v.points)) ** 2).sum(axis=1).mean()))


def write_scan(path: Path, name: str, seed: int, stored: Rig | None = None) -> None:
    """A turn of a part as it stands, as a scan file, which says that ``stored`` took it."""
    plan = ScanPlan(320, 240, "uint8", 1, ("L0",), STEPS, 12.0)
    u, angles = np.arange(320), full_turn(STEPS)
    rng = np.random.default_rng(seed)
    with Scan.create(path, plan, stored or rig_for(name)) as scan:
        for k, stripe in enumerate(with_noise(stripes(name), 0.05, seed)):
            at = np.nan_to_num(stripe.position, nan=-1e3)[:, None]
            light = 180 * np.exp(-0.5 * ((u - at) / 1.5) ** 2) + rng.normal(12, 1.0, (240, 320))
            dark = rng.normal(12, 1.0, (240, 320))
            as_u8 = [np.clip(np.rint(p), 0, 255).astype(np.uint8) for p in (light, dark)]
            scan.add(Frame(k, "L0", *as_u8, commanded=float(angles[k])))


def wavy(seed: int, border: float = 1.0) -> View:
    """A sheet of 20 × 20 mm with waves, a point each 0.5 mm; its rim is no inner part."""
    draw = np.random.default_rng(seed)
    x, y = (a.ravel() for a in np.meshgrid(np.arange(-10, 10, 0.5), np.arange(-10, 10, 0.5)))
    x, y = x + draw.uniform(-0.1, 0.1, x.shape), y + draw.uniform(-0.1, 0.1, y.shape)
    points = np.stack([x, y, np.sin(0.4 * x) + 0.5 * np.cos(0.5 * y)], axis=-1)
    up = np.stack([-0.4 * np.cos(0.4 * x), 0.25 * np.sin(0.5 * y), np.ones_like(x)], axis=-1)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    inner = np.maximum(abs(x), abs(y)) < 10 - border
    sigma = draw.uniform(0.01, 0.03, len(x))
    return View(f"sheet {seed}", points, up, sigma, points + 100 * up, inner, 0.5)
