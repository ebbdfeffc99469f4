"""The parts of the simulator: triangles, exact distance from the true surface, dimensions.

Parts stand on z = 0 with z up, in mm. `part` finds one by name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from turnscan.errors import InputError
from turnscan.mesh import Mesh, is_closed
from turnscan.simulate import _forms as forms
from turnscan.simulate import _solids as solids
from turnscan.simulate import _truth as truth


@dataclass(frozen=True)
class Part:
    """A body whose true shape is known."""

    name: str
    mesh: Mesh
    """Closed triangles, within ``chord`` of the true surface."""
    distance: truth.Distance | None = None
    """Signed distance (...,) mm of points (..., 3) from the true surface, positive outside; None
    for a free form, whose mesh is its truth."""
    dimensions: Mapping[str, float] = field(default_factory=dict)
    """Certified dimensions, mm (angles in radians), by name."""
    chord: float = solids.CHORD
    """mm: largest distance of the triangles from the true surface."""


def sphere(radius: float = 20.0) -> Part:
    """A ball that touches the table."""
    m = solids.ball(radius)
    lifted = Mesh(m.vertices + (0, 0, radius), m.faces)
    d = truth.sphere(radius, (0, 0, radius))
    return Part("sphere", lifted, d, {"diameter": 2 * radius})


def ball_bar(radius: float = 15.0, length: float = 100.0) -> Part:
    """Two equal balls, one above the other, on a thin rod; ``length`` between their centres."""
    low, high = radius + 5.0, radius + 5.0 + length
    rod = [(0, 0), (radius * 0.7, 0), (radius * 0.7, 2), (4, 4), (4, high), (0, high)]
    m = solids.ball(radius)
    meshes = [Mesh(m.vertices + (0, 0, z), m.faces) for z in (low, high)]
    d = truth.union(
        truth.sphere(radius, (0, 0, low)), truth.sphere(radius, (0, 0, high)), truth.revolved(rod)
    )
    mesh = solids.joined([*meshes, solids.revolved(rod)])
    return Part("ball-bar", mesh, d, {"diameter": 2 * radius, "length": length})


def plate(width: float = 60.0, thickness: float = 8.0, height: float = 80.0) -> Part:
    """An upright plate; its broad faces look along ±x."""
    w, t = width / 2, thickness / 2
    mesh = solids.extruded([(-t, -w), (t, -w), (t, w), (-t, w)], 0, height)
    d = truth.box((-t, -w, 0), (t, w, height))
    return Part("plate", mesh, d, {"width": width, "thickness": thickness, "height": height})


def _turned(name: str, profile: list[tuple[float, float]], dimensions: dict[str, float]) -> Part:
    return Part(name, solids.revolved(profile), truth.revolved(profile), dimensions)


def cylinder(radius: float = 25.0, height: float = 80.0) -> Part:
    """A plain cylinder."""
    profile = [(0.0, 0.0), (radius, 0.0), (radius, height), (0.0, height)]
    return _turned("cylinder", profile, {"diameter": 2 * radius, "height": height})


def cone(low: float = 35.0, high: float = 10.0, height: float = 70.0) -> Part:
    """A truncated cone."""
    profile = [(0.0, 0.0), (low, 0.0), (high, height), (0.0, height)]
    half = float(np.arctan2(low - high, height))
    return _turned("cone", profile, {"half_angle": half, "diameter": 2 * low, "height": height})


def torus(major: float = 30.0, minor: float = 10.0) -> Part:
    """A ring lying on the table."""
    n = solids.sides(minor)
    turn = np.arange(n) * (2 * np.pi / n)
    section = np.column_stack([major + minor * np.cos(turn), minor + minor * np.sin(turn)])
    mesh = solids.revolved(np.concatenate([section, section[:1]]))
    dimensions = {"major_diameter": 2 * major, "minor_diameter": 2 * minor}
    return Part("torus", mesh, truth.torus(major, minor, minor), dimensions)


def shaft() -> Part:
    """A stepped shaft, Ø50, Ø36 and Ø24, chamfered, with a keyway of 8 × 4 in its middle step."""
    low = [(0, 0), (24, 0), (25, 1), (25, 24), (24, 25), (0, 25)]
    high = [(0, 65), (12, 65), (12, 84), (11, 85), (0, 85)]
    n = solids.sides(18.0)
    edge = float(np.arcsin(4 / 18))
    turn = edge + np.arange(n + 1) / n * (2 * np.pi - 2 * edge)
    arc = 18 * solids.even_radius(n) * np.column_stack([np.cos(turn), np.sin(turn)])
    outline = np.concatenate([arc, [(14.0, -4.0), (14.0, 4.0)]])
    keyed = solids.extruded(outline, 25, 65)
    mesh = solids.joined([solids.revolved(low), keyed, solids.revolved(high)])
    d = truth.union(truth.revolved(low), truth.prism(outline, 25, 65), truth.revolved(high))
    sizes = {"diameter_low": 50.0, "diameter_middle": 36.0, "diameter_high": 24.0}
    return Part("shaft", mesh, d, {**sizes, "key_width": 8.0, "key_floor": 14.0, "height": 85.0})


def hexagon(flats: float = 40.0, height: float = 40.0) -> Part:
    """A hexagonal prism with a round boss on top."""
    turn = np.arange(6) * (np.pi / 3)
    outline = flats / 3**0.5 * np.column_stack([np.cos(turn), np.sin(turn)])
    boss = [(0, height), (12, height), (12, height + 15), (0, height + 15)]
    mesh = solids.joined([solids.extruded(outline, 0, height), solids.revolved(boss)])
    d = truth.union(truth.prism(outline, 0, height), truth.revolved(boss))
    return Part("hexagon", mesh, d, {"across_flats": flats, "boss_diameter": 24.0})


def gear(teeth: int = 20, module: float = 3.0, height: float = 30.0) -> Part:
    """A gear-like part: straight-flanked teeth on a disc, with a hub."""
    root, tip = module * (teeth / 2 - 1.25), module * (teeth / 2 + 1)
    shares = np.array([0.0, 0.22, 0.34, 0.66, 0.78])
    radii = np.array([root, root, tip, tip, root])
    turn = ((np.arange(teeth)[:, None] + shares) * (2 * np.pi / teeth)).ravel()
    outline = np.tile(radii, teeth)[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    hub = [(0, height), (12, height), (12, height + 20), (0, height + 20)]
    mesh = solids.joined([solids.extruded(outline, 0, height), solids.revolved(hub)])
    d = truth.union(truth.prism(outline, 0, height), truth.revolved(hub))
    return Part("gear", mesh, d, {"tip_diameter": 2 * tip, "hub_diameter": 24.0})


def bracket(hole: float = 24.0) -> Part:
    """An angle bracket: a foot of 60 × 40 × 10, and a wall of 60 × 10 × 70 with a round hole."""
    foot = solids.extruded([(-30, -20), (30, -20), (30, 20), (-30, 20)], 0, 10)
    n = solids.sides(hole / 2)
    turn = np.arange(n + 1) * (2 * np.pi / n)
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    # Wall seen along y: a rectangle 60 × 60 (x, z − 40), met from the hole along each direction.
    out = ring * (30.0 / np.abs(ring).max(axis=1, keepdims=True))
    bore = solids.even_radius(n) * hole / 2 * ring
    rims = [(out, -5.0), (out, 5.0), (bore, 5.0), (bore, -5.0), (out, -5.0)]
    grid = np.stack([np.column_stack([a[:, 0], -np.full(n + 1, y), a[:, 1]]) for a, y in rims])
    wall = solids.patch(grid + (0, -15, 40))
    d = truth.union(
        truth.box((-30, -20, 0), (30, 20, 10)),
        truth.difference(truth.box((-30, -20, 10), (30, -10, 70)), _bore(hole / 2)),
    )
    return Part("bracket", solids.joined([foot, wall]), d, {"hole_diameter": hole})


def _bore(radius: float) -> truth.Distance:
    return lambda p: np.asarray(np.hypot(p[..., 0], p[..., 2] - 40) - radius)


def _upright(name: str, x: list[float], top: list[float], sizes: dict[str, float]) -> Part:
    """A ribbon stood on its end: its worked face looks along +x, its length runs along z."""
    height = 80.0
    flat = solids.ribbon(x, top, 0.0, height)
    v = flat.vertices[:, [2, 0, 1]] + (0, 0, height / 2)
    d = truth.ribbon(x, top, 0.0, height)
    return Part(
        name, Mesh(v, flat.faces), lambda p: d(p[..., [1, 2, 0]] - (0, height / 2, 0)), sizes
    )


def grooves() -> Part:
    """A plate with grooves 2, 1 and 0.5 mm wide, each as deep as 1 mm, 15 mm apart."""
    x, top = [-30.0], [10.0]
    for at, width in ((-15.0, 2.0), (0.0, 1.0), (15.0, 0.5)):
        x += [at - width / 2, at - width / 2, at + width / 2, at + width / 2]
        top += [10.0, 9.0, 9.0, 10.0]
    return _upright("grooves", [*x, 30.0], [*top, 10.0], {"depth": 1.0, "pitch": 15.0})


def v_groove(opening: float = np.pi / 2) -> Part:
    """A block with a V groove 15 mm deep: light bounces from one flank to the other."""
    half = 15.0 * float(np.tan(opening / 2))
    x = [-half - 8, -half, 0.0, half, half + 8]
    return _upright("v-groove", x, [25.0, 25.0, 10.0, 25.0, 25.0], {"opening": opening})


def cup(wall: float = 2.5) -> Part:
    """A coffee cup without a handle: slightly conical, thin-walled, hollow, on a foot ring."""
    profile = forms.cup_profile(wall)
    mesh, d = solids.revolved(profile), truth.revolved(profile)
    return Part("cup", mesh, d, {"wall": wall, "height": float(profile[:, 1].max())})


def mug(wall: float = 2.5) -> Part:
    """The cup with a handle."""
    profile = forms.cup_profile(wall)
    handle = solids.swept(forms.handle_path(), (3.5, 5.5))
    return Part("mug", solids.joined([solids.revolved(profile), handle]), None, {"wall": wall})


def head() -> Part:
    """A head-like free form with a nose, brows, ears and a neck, 108 mm tall (half size)."""
    return Part("head", forms.head())


def mannequin() -> Part:
    """The head with a sharper nose: one line at 22.4° leaves a strip beside it in the shadow."""
    return Part("mannequin", forms.head(steep=2))


def bust() -> Part:
    """A bust-like free form: a bearded head on shoulders and a plinth, 120 mm tall."""
    return Part("bust", forms.bust())


PARTS: Mapping[str, Callable[[], Part]] = {
    "sphere": sphere,
    "ball-bar": ball_bar,
    "plate": plate,
    "cylinder": cylinder,
    "cone": cone,
    "torus": torus,
    "shaft": shaft,
    "hexagon": hexagon,
    "gear": gear,
    "bracket": bracket,
    "grooves": grooves,
    "v-groove": v_groove,
    "cup": cup,
    "mug": mug,
    "head": head,
    "mannequin": mannequin,
    "bust": bust,
}


def part(name: str) -> Part:
    """The part of that name; raises InputError that lists the names there are."""
    if name not in PARTS:
        raise InputError(
            f"no simulated part {name!r}",
            hint=f"choose one of {', '.join(PARTS)}, or give a mesh file",
        )
    return _made(PARTS[name])


@lru_cache(maxsize=4)
def _made(make: Callable[[], Part]) -> Part:
    """The last ones are kept: triangles of round parts take a second, and devices are opened with
    the same part again and again."""
    return make()


def from_mesh(name: str, mesh: Mesh) -> Part:
    """Any triangles as a part; its truth is the mesh itself, turned where it is inside out.

    Raises InputError without faces.
    """
    if not len(mesh.faces):
        raise InputError(f"{name}: the mesh has no faces", hint="export it again as triangles")
    if mesh.volume < 0 and is_closed(mesh):
        mesh = replace(mesh, faces=mesh.faces[:, ::-1])
    return Part(name, mesh, None, {}, 0.0)
