"""Parts and poses for judging causes of holes: one set to make the rules with, one held out.

Scenes of the held-out set that were looked at to make a rule were moved to the other set (eight,
six later, a plate, a bracket, and four for decision 73), and new ones, of the same kinds, put in
their place, unseen. Of the newest fifteen the outcome was seen before two weights of that decision
were chosen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from turnscan.arrays import Floats
from turnscan.formats import write_stl
from turnscan.mesh import Mesh
from turnscan.simulate import Material, SimulationSpec
from turnscan.simulate import _solids as solids

BLACK = 0.002
"""Reflectance of the painted squares, over that of the rest."""
PAINTED = Material((0.6, 0.6, 0.6), pattern="checks", pitch=12.0, pattern_ratio=BLACK)


@dataclass(frozen=True)
class Scene:
    """A part as it stands on the table; angles in degrees, lengths in mm."""

    name: str
    """Of a part of the simulator, or of a random form."""
    tip: float = 0.0
    lean: tuple[float, float] = (0.0, 0.0)
    shift: tuple[float, float] = (0.0, 0.0)
    seed: int = 0
    paint: Material | None = None
    steps: int = 48

    def spec(self, rig: str, folder: Path) -> SimulationSpec:
        """The bench; a random form is written into the folder."""
        a, b = self.lean
        scene = self.name
        if scene in FORMS:
            path = folder / f"{scene}-{self.seed}.stl"
            if not path.exists():
                path.write_bytes(write_stl(FORMS[scene](np.random.default_rng(self.seed))))
            scene = str(path)
        return SimulationSpec(
            scene, rig, lasers=2, steps=self.steps, seed=self.seed, tip=math.radians(self.tip),
            lean=(math.radians(a), math.radians(b)), shift=self.shift,
        )  # fmt: skip

    def __str__(self) -> str:
        words = [self.name]
        words += [f"seed {self.seed}"] if self.seed else []
        words += ["painted"] if self.paint is not None else []
        words += [f"tipped {self.tip:.0f}°"] if self.tip else []
        words += [f"leaning {max(map(abs, self.lean)):.0f}°"] if any(self.lean) else []
        words += [f"{self.steps} steps"] if self.steps != 48 else []
        return " ".join(words)


def _displaced(draw: np.random.Generator) -> Mesh:
    """A ball of 22 mm with eight waves over it."""
    m = solids.ball(22.0, 0.05)
    unit = m.vertices / np.linalg.norm(m.vertices, axis=1, keepdims=True)
    way, phase = draw.normal(0.0, 2.2, (8, 3)), draw.uniform(0.0, 2 * np.pi, 8)
    rise = (draw.uniform(0.3, 1.3, 8) * np.sin(unit @ way.T + phase)).sum(axis=1)
    return Mesh(unit * (22.0 + rise)[:, None], m.faces)


def _twisted(draw: np.random.Generator) -> Mesh:
    """A prism of three to seven sides, twisted and tapered."""
    sides, high = int(draw.integers(3, 8)), float(draw.uniform(35.0, 60.0))
    twist, taper = draw.uniform(-0.9, 0.9), draw.uniform(0.6, 1.0)
    reach = float(draw.uniform(16.0, 24.0)) * math.cos(math.pi / sides)

    def radius(z: Floats, turn: Floats) -> Floats:
        share = z / high
        face = (turn - twist * share) % (2 * np.pi / sides) - np.pi / sides
        return np.asarray(reach * (1.0 - (1.0 - taper) * share) / np.cos(face))

    return solids.radial(radius, np.linspace(0.0, high, 41), 360)


def _stepped(draw: np.random.Generator) -> Mesh:
    """A turned part with five steps and grooves."""
    r, rise = draw.uniform(8.0, 24.0, 5), np.cumsum(draw.uniform(5.0, 13.0, 5))
    profile = [(0.0, 0.0)]
    for k, z in enumerate(rise):
        low = rise[k - 1] if k else 0.0
        profile += [(float(r[k]), float(low)), (float(r[k]), float(z))]
    return solids.revolved([*profile, (0.0, float(rise[-1]))], 180)


FORMS: Mapping[str, Callable[[np.random.Generator], Mesh]] = {
    "displaced-ball": _displaced,
    "twisted-prism": _twisted,
    "stepped-shaft": _stepped,
}
"""Random forms, each a closed mesh of a generator."""

MADE_WITH = (
    Scene("sphere"),
    Scene("cup"),
    Scene("bracket"),
    Scene("torus"),
    Scene("sphere", paint=PAINTED),
    Scene("bracket", lean=(0.0, -60.0), shift=(40.0, 0.0)),
    Scene("v-groove", lean=(-45.0, 0.0), shift=(-45.0, -40.0)),
    Scene("torus", tip=90.0, shift=(0.0, 30.0)),
    Scene("displaced-ball", seed=1),
    Scene("twisted-prism", seed=1, tip=90.0),
    Scene("stepped-shaft", seed=1, tip=90.0),
    Scene("grooves", lean=(30.0, 0.0)),
    Scene("plate", lean=(0.0, 35.0), shift=(-20.0, 0.0)),
    Scene("twisted-prism", seed=11, lean=(0.0, 30.0)),
    Scene("plate", lean=(-40.0, 15.0), shift=(0.0, -20.0)),
    Scene("bracket", tip=90.0),
    Scene("twisted-prism", seed=12, tip=90.0),
    Scene("displaced-ball", seed=12, lean=(50.0, 20.0)),
    Scene("stepped-shaft", seed=13, lean=(20.0, 0.0)),
    Scene("displaced-ball", seed=22, lean=(50.0, 20.0)),
    Scene("twisted-prism", seed=22, tip=90.0),
    Scene("plate", lean=(-50.0, 25.0), shift=(10.0, -15.0)),
    Scene("bracket", tip=90.0, shift=(10.0, 15.0)),
    Scene("v-groove", lean=(20.0, 30.0), shift=(-10.0, 0.0)),
    Scene("cone", lean=(0.0, 40.0), shift=(-15.0, 0.0)),
    Scene("plate", lean=(0.0, -55.0), shift=(-10.0, 0.0), steps=60),
    Scene("bracket", tip=90.0, shift=(-12.0, -25.0), steps=60),
    Scene("bracket", lean=(40.0, -20.0), shift=(5.0, -15.0), steps=60),
    Scene("bracket", tip=90.0, shift=(20.0, -8.0), steps=72),
    Scene("displaced-ball", seed=51, lean=(60.0, 0.0), steps=60),
    Scene("gear", lean=(-20.0, 0.0), steps=160),
)
"""Looked at while the rules were made."""
HELD_OUT = (
    Scene("sphere", seed=7, paint=PAINTED),
    Scene("displaced-ball", seed=11),
    Scene("stepped-shaft", seed=11),
    Scene("stepped-shaft", seed=12, tip=90.0),
    Scene("grooves", lean=(0.0, -25.0), shift=(15.0, 0.0)),
    Scene("twisted-prism", seed=14, lean=(35.0, 0.0)),
    Scene("displaced-ball", seed=14, tip=90.0),
    Scene("hexagon"),
    Scene("shaft", tip=90.0),
    Scene("gear", tip=90.0),
    Scene("mug", tip=90.0),
    Scene("cylinder", lean=(25.0, 0.0), shift=(0.0, 15.0)),
    Scene("plate", lean=(-16.0, -41.0), shift=(-1.0, -7.0), steps=60),
    Scene("v-groove", lean=(-35.0, 10.0), shift=(5.0, 10.0), steps=60),
    Scene("twisted-prism", seed=52, tip=90.0, steps=60),
    Scene("cone", lean=(0.0, -50.0), shift=(10.0, 5.0), steps=60),
    Scene("hexagon", lean=(0.0, 65.0), steps=60),
    Scene("mug", lean=(35.0, 15.0), steps=160),
    Scene("stepped-shaft", seed=53, lean=(75.0, 0.0), steps=160),
    Scene("twisted-prism", seed=61, lean=(-33.0, 14.0), shift=(-4.0, 0.0), steps=90),
    Scene("bracket", lean=(47.0, -29.0), shift=(4.0, 7.0), steps=60),
    Scene("displaced-ball", seed=62, lean=(-4.0, -31.0), shift=(6.0, -3.0)),
    Scene("cylinder", shift=(-10.0, -2.0), steps=90),
    Scene("cup", shift=(9.0, 2.0)),
    Scene("v-groove", tip=90.0, shift=(-8.0, -3.0)),
    Scene("bracket", tip=90.0, shift=(8.0, 1.0)),
    Scene("twisted-prism", seed=63, lean=(24.0, -13.0), shift=(-3.0, 9.0), steps=90),
    Scene("twisted-prism", seed=64, shift=(3.0, -7.0), steps=60),
    Scene("stepped-shaft", seed=65, shift=(6.0, -7.0)),
    Scene("v-groove", lean=(-28.0, -29.0), shift=(10.0, -4.0), steps=90),
    Scene("cylinder", lean=(-41.0, -29.0), shift=(1.0, -8.0), steps=60),
    Scene("cylinder", lean=(39.0, -5.0), shift=(6.0, -4.0), steps=90),
    Scene("grooves", tip=90.0, shift=(8.0, -3.0), steps=90),
    Scene("gear", lean=(0.0, 25.0), steps=160),
)
"""Looked at when the rules stood, but as said above."""
