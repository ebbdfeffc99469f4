"""Draws the pictures of simulated benches for the docs: `python docs/make_pictures.py [NAME …]`.

Names: galvanometer, two_lines, shadows, panned, off_centre, demo, fills, report, poses, section,
views, verification; without one, all (fifteen minutes).
"""

from __future__ import annotations

import base64
import io
import math
import re
import shutil
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image as Pillow

from turnscan.arrays import Floats, Image
from turnscan.cli import turnscan
from turnscan.formats import read_mesh
from turnscan.mesh import (
    Mesh,
    Provenance,
    cut_touching,
    submesh,
)
from turnscan.rig import Rig, design_preset, rig_to_json
from turnscan.shapes import Cut
from turnscan.simulate import (
    Bench,
    Renderer,
    SimCamera,
    SimLasers,
    SimTurntable,
    Simulated,
    SimulationSpec,
    World,
    bench,
    part,
    seconds_of,
    simulated,
)
from turnscan.surface.decimation import decimate
from turnscan.surface.holes import (
    FillHow,
    fill,
    holes,
)
from turnscan.workflows._scanning._simulated import plan_of, scan_into_file

HERE = Path(__file__).parent / "pictures"
SECONDS = seconds_of(SimulationSpec())


def picture(made: Bench, angle: float, *lit: str, seconds: float = SECONDS, shot: int = 0) -> Image:
    """One picture; without names all lasers are lit."""
    names = lit or tuple(b.name for b in made.beams)
    renderer = Renderer(made)
    return renderer.picture(angle, names, seconds, start=0.0031 * shot, shot=shot)


def save(figure: Figure, name: str) -> None:
    """Write docs/pictures/NAME.png."""
    figure.savefig(HERE / f"{name}.png", dpi=90, metadata={"Software": None})


def show(axes: object, image: Image, title: str, gain: float = 2.0) -> None:
    """A camera picture, brightened as an eye would see it."""
    grey = image if image.ndim == 2 else image.max(axis=2)
    top = np.iinfo(image.dtype).max
    axes.imshow((grey / top * gain).clip(0, 1) ** 0.6, cmap="gray")  # type: ignore[attr-defined]
    axes.set_title(title, fontsize=10)  # type: ignore[attr-defined]
    axes.set_axis_off()  # type: ignore[attr-defined]


def galvanometer() -> None:
    """A swept spot: bright ends, and a beat where the exposure is no whole number of sweeps."""
    figure = Figure(figsize=(10, 4), layout="constrained")
    axes = figure.subplots(1, 2)
    made = bench(SimulationSpec("cylinder", waves="diffraction", room=0.0))
    for frequency, style in ((300.0, "-"), (105.0, "-"), (137.0, ":")):
        beam = replace(made.beams[0], frequency=frequency)
        s = np.linspace(-0.999, 0.999, 1500)
        axes[0].plot(s, beam.share(s, 0.0, SECONDS), style, label=f"{frequency:.0f} Hz")
    axes[0].set_xlabel("place in the fan, −1 to 1")
    axes[0].set_ylabel("share of the power")
    axes[0].set_ylim(0, 1.2)
    axes[0].legend(title=f"exposure {SECONDS * 1000:.0f} ms")
    slow = replace(made, beams=(replace(made.beams[0], frequency=105.0),))
    for shot in range(3):
        light = picture(slow, 0.0, shot=shot).astype(float).sum(axis=1)
        axes[1].plot(light, label=f"picture {shot + 1}", linewidth=0.8)
    axes[1].set_xlabel("image row")
    axes[1].set_ylabel("brightness of the line, grey levels")
    axes[1].set_title("105 Hz: the boundary between 8 and 9 passes wanders", fontsize=10)
    axes[1].legend()
    save(figure, "galvanometer")


def two_lines() -> None:
    """The head lit from both sides: what one laser loses behind the nose the other one lights."""
    made = bench(SimulationSpec("head", lasers=2))
    figure = Figure(figsize=(11, 3.2), layout="constrained")
    for axes, lit in zip(figure.subplots(1, 3), (("right",), ("left",), ()), strict=True):
        title = f"laser {lit[0]}" if lit else "both"
        show(axes, picture(made, 0.42, *lit), title)
    save(figure, "two-lines")


def lit_share(made: Bench, steps: int = 40) -> float:
    """Share of the picture's rows across the part in which a stripe is seen, over one turn."""
    quiet = replace(made, waves="rays", noise=False, bounces=False)
    quiet = replace(quiet, scene=replace(quiet.scene, bodies=quiet.scene.bodies[:1]))
    renderer = Renderer(quiet)
    seen = []
    for k in range(steps):
        T = quiet.rig.T_camera_table @ quiet.motion.pose(2 * math.pi * k / steps)
        light = renderer.laser_light(T, quiet.beams[0], SECONDS)
        across = (renderer.view.seen(T).reshape(light.shape) >= 0).any(axis=1)
        seen.append((light.sum(axis=1) > 0.1 * np.median(light.sum(axis=1)[across])) & across)
        seen[-1] = seen[-1].sum() / across.sum()
    return float(np.mean(seen))


def shadows() -> None:
    """Fig. 5: a larger angle resolves more and sees less."""
    angles = (10, 15, 22.4, 30, 45, 60)
    shares = [
        lit_share(bench(SimulationSpec("head", theta=math.radians(a), lasers=1))) for a in angles
    ]
    step = [design_resolution(a) for a in angles]
    figure = Figure(figsize=(10, 3.6), layout="constrained")
    first, chart = figure.subplots(1, 2, width_ratios=[1, 1.2])
    show(
        first,
        picture(bench(SimulationSpec("head", theta=math.radians(45), lasers=1)), 0.42),
        "θ = 45°",
    )
    chart.plot(angles, np.array(shares) * 100, "o-", label="rows with a stripe, %")
    chart.plot(angles, np.array(step) * 100, "s--", label="ΔR per pixel at the axis, 0.01 mm")
    chart.set_xlabel("θ, degrees")
    chart.legend()
    save(figure, "shadows")


def design_resolution(angle: float) -> float:
    """ΔR at the axis, mm, of the paper's rig."""
    return float(replace(design_preset("paper"), theta=math.radians(angle)).delta_r())


def panned() -> None:
    """Fig. 7: a camera whose axis misses the rotation axis spends all its columns on one side."""
    figure = Figure(figsize=(10, 3.4), layout="constrained")
    straight = bench(SimulationSpec("sphere"))
    panned = replace(design_preset("paper"), focal=25.5, pan=math.radians(7.86))
    rig = panned.rig(height=20.0)
    back, there = straight.rig.T_camera_table.inverse(), rig.T_camera_table
    turn = there @ back
    beams = tuple(replace(b, apex=turn.apply(b.apex), aim=turn.turn(b.aim)) for b in straight.beams)
    lens = replace(straight.lens, focal=25.5 * 500 / 525.5)
    aside = replace(straight, rig=rig, beams=beams, lens=lens)
    for axes, made, title in zip(
        figure.subplots(1, 2),
        (straight, aside),
        ("axis in the middle, f = 12.5 mm", "panned by 7.86°, f = 25.5 mm"),
        strict=True,
    ):
        image = picture(made, 0.0)
        foot = made.rig.camera.project(made.rig.T_camera_table.apply(axis()))
        show(axes, image, title)
        axes.plot(foot[:, 0], foot[:, 1], "c--", linewidth=0.8)
        axes.set_xlim(0, 639)
        axes.set_ylim(479, 0)
    save(figure, "panned-camera")


def axis() -> Floats:
    """Points of the rotation axis, mm."""
    return np.column_stack([np.zeros((20, 2)), np.linspace(0, 45, 20)])


def off_centre() -> None:
    """Fig. 8: the same part off the axis; some profiles fall where the laser does not reach."""
    figure = Figure(figsize=(10, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.2])
    show(
        left,
        picture(bench(SimulationSpec("hexagon", shift=(35.0, 0.0))), 2.0),
        "35 mm off the axis",
    )
    shifts = (0, 10, 20, 30, 40, 50)
    shares = [
        100 * lit_share(bench(SimulationSpec("hexagon", shift=(float(x), 0.0)))) for x in shifts
    ]
    right.plot(shifts, shares, "o-")
    right.set_xlabel("distance of the part from the axis, mm")
    right.set_ylabel("rows with a stripe over a turn, %")
    right.set_ylim(0, 105)
    save(figure, "off-centre")


def demo() -> None:
    """What `turnscan demo` draws: stripe, quality, deviation; a strip of four for the README."""
    with tempfile.TemporaryDirectory() as folder:
        turnscan(["demo", "-o", folder], standalone_mode=False)
        made = {
            name: Pillow.open(Path(folder) / f"{name}.png").convert("RGB")
            for name in ("stripe", "grid", "mesh", "quality", "deviation")
        }
    for name in ("stripe", "quality", "deviation"):
        target = HERE / f"demo-{'frame' if name == 'stripe' else name}.png"
        small(made[name], 1000).save(target, optimize=True)
    rows = [(made["stripe"], made["mesh"]), (made["grid"], made["deviation"])]
    strip(rows, width=1100).save(HERE / "demo.png", optimize=True)


def fills() -> None:
    """The head with its crown and a cheek cut out, and filled in the three ways."""
    whole = decimate(part("head").mesh, faces=40_000)
    middle = whole.triangles.mean(axis=1)
    cut = np.zeros(len(middle), dtype=np.bool_)
    for centre, radius in (((0.0, 0.0, 112.0), 32.0), ((26.0, -32.0, 47.0), 14.0)):
        cut |= np.linalg.norm(middle - centre, axis=1) < radius
    torn, _ = cut_touching(submesh(whole, ~cut))
    pictures = [torn.show(azimuth=0.9, elevation=0.5, size=(360, 400)).pixels]
    ways: tuple[FillHow, ...] = ("flat", "tangent", "curvature")
    for how in ways:
        mesh = fill(torn, holes(torn), how)
        assert mesh.measured is not None
        colour = np.full((len(mesh.vertices), 3), (122.0, 158.0, 196.0))
        colour[mesh.faces[~mesh.measured]] = (232.0, 150.0, 70.0)
        pictures.append(
            mesh.show(azimuth=0.9, elevation=0.5, size=(360, 400), colour=colour).pixels
        )
    row = tuple(Pillow.fromarray(p) for p in pictures)
    strip([row], width=1100).save(HERE / "fills.png", optimize=True)


def report() -> None:
    """What `turnscan reconstruct --report` draws of a bracket: coverage, noise, before, after.

    A bracket has what a level camera does not see.
    """
    with tempfile.TemporaryDirectory() as name:
        scan, page = Path(name) / "bracket.turnscan", Path(name) / "report.html"
        words = ["simulate", "bracket", "--lasers", "1", "--steps", "100", "-o", str(scan)]
        turnscan(words, standalone_mode=False)
        words = ["reconstruct", str(scan), "-o", str(scan.with_suffix(".stl")), "--close"]
        turnscan([*words, "--report", str(page)], standalone_mode=False)
        drawn = re.findall('data:image/png;base64,([^"]+)', page.read_text())
    maps, views = drawn[:2], drawn[2:4]
    rows = [
        tuple(Pillow.open(io.BytesIO(base64.b64decode(text))).convert("RGB") for text in row)
        for row in (maps, views)
    ]
    strip(rows, width=1100).save(HERE / "report.png", optimize=True)


def poses() -> None:
    """A cup scanned standing and lying, and both as one surface, from above its rim."""
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        for name, tip, seed in (("up", 0, 1), ("side", 90, 2)):
            words = f"simulate cup --rig modern --steps 120 --seed {seed} --tip-deg {tip}".split()
            turnscan([*words, "-o", f"{at / name}.turnscan"], standalone_mode=False)
        scans = [str(at / f"{n}.turnscan") for n in ("up", "side")]
        for name, words in (
            ("up", ["reconstruct", scans[0]]),
            ("side", ["reconstruct", scans[1]]),
            ("both", ["join", *scans]),
        ):
            turnscan([*words, "-o", f"{at / name}.ply"], standalone_mode=False)
        row = []
        for name, azimuth in (("up", 0.6), ("side", 2.6), ("both", 0.6)):
            mesh = read_mesh((at / f"{name}.ply").read_bytes(), ".ply")
            view = mesh.show(azimuth=azimuth, elevation=0.75, size=(480, 480)).pixels
            row.append(Pillow.fromarray(view))
    strip([tuple(row)], width=1100).save(HERE / "poses.png", optimize=True)


def verification() -> None:
    """Nine weeks of a ball bar on the paper's rig, whose laser moves by 0.05 mm in the seventh."""
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        turnscan(["artefact", "ball-bar", "-o", str(at)], standalone_mode=False)
        toml = at / "ball-bar.toml"
        text = toml.read_text().replace('measured = ""', 'measured = "J. Doe, micrometer No. 7"')
        text = text.replace("= [0.2, 0.2]", "= 0.004").replace("_U_mm = 0.2", "_U_mm = 0.006")
        toml.write_text(text.replace("form_mm = 0.05", "form_mm = 0.003"))
        words = ["--artefact", str(toml), "--history", str(at / "h.sqlite"), "--limit", "size=0.15"]
        words += ["--limit", "distance=0.05", "--report", str(at / "report.html")]
        rig = at / "rig.json"
        for week in range(9):
            scan = at / f"week-{week + 1}.turnscan"
            rig.write_text(rig_to_json(_bar_scan(scan, week, 0.05 if week >= 6 else 0.0)))
            day = f"{date(2026, 3, 2) + timedelta(weeks=week)}"
            words_of = ["verify", str(scan), *words, "--rig", str(rig), "--date", day]
            with suppress(SystemExit):  # 1, once the alarm sounds
                turnscan([*words_of, "--trend", str(at / "trend.png")], standalone_mode=False)
        small(Pillow.open(at / "trend.png").convert("RGB"), 1000).save(
            HERE / "verification-trend.png", optimize=True
        )
        _page_picture(at / "report.html", HERE / "verification-report.png")


def _bar_scan(path: Path, seed: int, moved: float) -> Rig:
    """A scan of a ball bar by a laser that moved by so many mm, and the rig as it was before."""
    d = simulated(f"sim:ball-bar?rig=paper&steps=12&seed={seed}")
    made, sheet, beam = d.world.bench, d.world.bench.rig.sheets[0], d.world.bench.beams[0]
    by = moved * sheet.normal
    rig = replace(made.rig, sheets=(replace(sheet, centre=sheet.centre + by),))
    world = World(replace(made, rig=rig, beams=(replace(beam, apex=beam.apex + by),)))
    seen = Simulated(d.spec, world, SimCamera(world), SimTurntable(world), SimLasers(world))
    scan_into_file(seen, plan_of(seen), path, "sparse")
    return made.rig


def _page_picture(page: Path, out: Path) -> None:
    """The top of a page as a browser shows it."""
    from playwright.sync_api import sync_playwright

    program = shutil.which("chromium") or shutil.which("chromium-browser")
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=program, args=["--no-sandbox"])
        view = browser.new_page(viewport={"width": 1200, "height": 900})
        view.goto(page.as_uri())
        data = view.screenshot()
        browser.close()
    small(Pillow.open(io.BytesIO(data)).convert("RGB"), 1000).save(out, optimize=True)


def section() -> None:
    """A plate with rounded corners and holes, cut: the drawing that ``turnscan section`` makes."""
    from turnscan.drawings import draw_section
    from turnscan.shapes import fit_section, plane_cut

    rng = np.random.default_rng(1)
    turn = np.linspace(0, np.pi / 2, 30)
    corner = 8 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    rows = []
    for k, at in enumerate(((32, 17), (-32, 17), (-32, -17), (32, -17))):
        c, s = np.round(np.cos(k * np.pi / 2)), np.round(np.sin(k * np.pi / 2))
        rows.append(corner @ np.array([[c, s], [-s, c]]) + at)
    corners = np.concatenate(rows)
    loops = [dense(corners, 0.4)]
    circle = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    for x, r in ((-20.0, 5.0), (20.0, 5.0), (0.0, 9.0)):
        loops.append(np.stack([x + r * np.cos(circle), -r * np.sin(circle)], axis=1))
    vertices, faces, count = [], [], 0
    for loop in loops:
        n, i = len(loop), np.arange(len(loop))
        for z in (0.0, 1.0):
            noisy = loop + rng.normal(0, 0.01, loop.shape)
            vertices.append(np.column_stack([noisy, np.full(n, z)]))
        a, b = count + i, count + np.roll(i, -1)
        faces += [np.stack([a, b, b + n], axis=1), np.stack([a, b + n, a + n], axis=1)]
        count += 2 * n
    points = np.concatenate(vertices)
    none = np.zeros(len(points), np.int32)
    known = Provenance(np.full(len(points), 0.01), none, none, none, ("laser",))
    mesh = Mesh(points, np.concatenate(faces).astype(np.int32), known)
    cut = fit_section(mesh, plane_cut([0, 0, 1], 0.5, "z = 0.5 mm"))
    save(draw_section(cut, "plate.ply"), "section")


def views() -> None:
    """A head from the side, and its surface unrolled: two sheets of ``turnscan section``."""
    from turnscan.shapes.views import silhouette_cut, unrolled_cut

    _sheets(
        "views", ("head", silhouette_cut([0, 1, 0], "silhouette from y")), ("head", unrolled_cut())
    )


def profiles() -> None:
    """The wall of a cup, and a head cut across: two sheets of ``turnscan section``."""
    from turnscan.shapes import half_plane_cut, plane_cut

    cup = half_plane_cut(np.radians(30.0), "half plane at 30°")
    _sheets("profiles", ("cup", cup), ("head", plane_cut([0, 0, 1], 40.0, "z = 40 mm")))


def _sheets(picture: str, *wanted: tuple[str, Cut]) -> None:
    """Sections of parts of which every point has 30 µm of noise, side by side."""
    from turnscan.drawings import draw_section
    from turnscan.shapes import fit_section

    sheets = []
    for name, cut in wanted:
        true = part(name).mesh
        n = len(true.vertices)
        none = np.zeros(n, np.int32)
        known = Provenance(np.full(n, 0.03), none, none, none, ("laser",))
        noise = np.random.default_rng(1).normal(0, 0.03, (n, 3))
        data = io.BytesIO()
        section = fit_section(Mesh(true.vertices + noise, true.faces, known), cut)
        draw_section(section, name).savefig(data, dpi=110)
        sheets.append(Pillow.open(data).convert("RGB"))
    strip([tuple(sheets)], 1400).save(HERE / f"{picture}.png", optimize=True)


def dense(corners: Floats, step: float) -> Floats:
    """Points every ``step`` mm round a closed polygon."""
    rows = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        n = max(int(np.ceil(np.linalg.norm(b - a) / step)), 1)
        rows.append(a + (b - a) * np.arange(n)[:, None] / n)
    return np.concatenate(rows)


def small(image: Pillow.Image, width: int) -> Pillow.Image:
    """Scaled down to this width, in few colours: a picture for a page."""
    scaled = image.resize((width, round(image.height * width / image.width)), Pillow.LANCZOS)
    return scaled.quantize(160, dither=Pillow.Dither.NONE)


def strip(rows: list[tuple[Pillow.Image, ...]], width: int, gap: int = 8) -> Pillow.Image:
    """Rows of pictures side by side, each row of one height and this wide."""
    lines = []
    for row in rows:
        height = (width - gap * (len(row) - 1)) / sum(i.width / i.height for i in row)
        line = Pillow.new("RGB", (width, round(height)), "white")
        x = 0.0
        for image in row:
            wide = image.width / image.height * height
            line.paste(image.resize((round(wide), round(height)), Pillow.LANCZOS), (round(x), 0))
            x += wide + gap
        lines.append(line)
    page = Pillow.new(
        "RGB", (width, sum(i.height for i in lines) + gap * (len(lines) - 1)), "white"
    )
    y = 0
    for line in lines:
        page.paste(line, (0, y))
        y += line.height + gap
    return page.quantize(200, dither=Pillow.Dither.NONE)


DRAWN: dict[str, Callable[[], None]] = {
    f.__name__: f
    for f in (
        galvanometer,
        two_lines,
        shadows,
        panned,
        off_centre,
        demo,
        fills,
        report,
        poses,
        section,
        views,
        profiles,
        verification,
    )
}

if __name__ == "__main__":
    HERE.mkdir(exist_ok=True)
    for wanted in sys.argv[1:] or DRAWN:
        DRAWN[wanted]()
        print(wanted)
