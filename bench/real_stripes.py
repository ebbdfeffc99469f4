"""Stripes in pictures of real scanners made by others (../shared/data, not part of turnscan)."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from turnscan.arrays import Image
from turnscan.calibrate import detect_board, parse_board
from turnscan.scan import read_picture
from turnscan.stripes import (
    Stripe,
    StripeFlag,
    StripeSettings,
    detect,
    learn_colour,
    project_colour,
)

DATA = Path(__file__).parents[2] / "shared" / "data"
Array = npt.NDArray[np.float64]


def read(path: Path) -> Image:
    """A colour picture, red, green, blue."""
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if picture is None:
        raise FileNotFoundError(path)
    return np.ascontiguousarray(picture[:, :, ::-1])


def pair(lit: Path, dark: Path, choose: str = "nearest") -> tuple[Stripe, Array]:
    """Learn the colour from a laser on/off pair and find the stripe; also the weights."""
    on, off = read(lit), read(dark)
    weights = learn_colour(on, off)
    settings = StripeSettings(choose=choose)  # type: ignore[arg-type]
    return detect(project_colour(on, weights), project_colour(off, weights), settings), weights


def roughness(position: Array) -> float:
    """Noise of the centres along the stripe, px: robust, from second differences."""
    bend = np.diff(position, 2)
    return float(np.nanmedian(np.abs(bend)) / (0.6745 * np.sqrt(6.0)))


def bust(data: Path) -> tuple[int, int, int]:
    """Rows with a stripe: all, on the bust (rows 50-1124), on the table's rim (1220-1279)."""
    folder = data / "ciclop-bust" / "laser_on_off_bust"
    stripe, _ = pair(folder / "laser.png", folder / "laser_background.png", "brightest")
    found = stripe.found
    return int(found.sum()), int(found[50:1125].sum()), int(found[1220:].sum())


def core_of(green: Image, row: int, near: float) -> tuple[float, float]:
    """Middle and width of the white core: where green, which does not glow, exceeds half."""
    line = green[row].astype(np.float64)
    u0 = max(0, round(near) - 30)
    part = line[u0 : u0 + 61]
    floor = float(np.median(part))
    above = np.flatnonzero(part > floor + 0.5 * (part.max() - floor))
    return float(u0 + above.mean()), float(len(above))


def ceramic(data: Path, lit: str, dark: str) -> dict[str, float]:
    """The glossy figure, rows 310-839: is the centre in the white core, and is it smooth?"""
    folder = data / "ceramic-pairs"
    stripe, weights = pair(folder / lit, folder / dark)
    on, off = read(folder / lit), read(folder / dark)
    green = cv2.subtract(on[:, :, 1], off[:, :, 1])
    rows = np.arange(310, 840)
    cores = np.array([core_of(green, int(v), stripe.position[v]) for v in rows if stripe.found[v]])
    away = np.abs(stripe.position[rows][stripe.found[rows]] - cores[:, 0])
    red = (
        cv2.subtract(on[:, :, 0], off[:, :, 0])[rows]
        > 0.2 * cv2.subtract(on[:, :, 0], off[:, :, 0])[rows].max()
    ).sum(axis=1)
    return {
        "weight of red": float(weights[0]),
        "weight of green": float(weights[1]),
        "rows found of 530": float(stripe.found[rows].sum()),
        "px from the middle of the core, median": float(np.median(away)),
        "px, 95 %": float(np.percentile(away, 95)),
        "width of the stripe, rms px": float(np.nanmedian(stripe.width[rows])),
        "width of the red glow, px": float(np.median(red)),
        "steps above 3 px between rows": float((np.abs(np.diff(stripe.position[rows])) > 3).sum()),
        "noise along the stripe, px": roughness(stripe.position[330:600]),
    }


def blocks(data: Path, name: str) -> dict[str, float]:
    """A step block: shift of the stripe on top of it against the bed, over the distinct frames."""
    frames: list[Image] = []
    for path in sorted((data / "step-blocks" / name).glob("*.jpg")):
        picture = project_colour(read(path), "grey")
        # The video repeats each frame three times; a repetition is no new measurement.
        if not frames or np.abs(picture.astype(int) - frames[-1]).mean() > 0.2:
            frames.append(picture)
    shifts, rough_bed, rough_top = [], [], []
    for frame in frames:
        stripe = detect(frame)
        u = stripe.position
        bed = np.r_[20:140, 390:460]
        # The laser's line leans a little: compare with the straight line through the bed.
        lean = np.polyfit(bed[np.isfinite(u[bed])], u[bed][np.isfinite(u[bed])], 1)
        top = np.arange(210, 320)
        shifts.append(float(np.nanmedian(np.polyval(lean, top) - u[top])))
        rough_bed.append(roughness(u[20:140]))
        rough_top.append(roughness(u[210:320]))
    return {
        "distinct frames": float(len(frames)),
        "shift, px": float(np.mean(shifts)),
        "rms of the shift over the frames, px": float(np.std(shifts, ddof=1)),
        "noise along the stripe on the bed, px": float(np.median(rough_bed)),
        "noise along the clipped stripe on the block, px": float(np.median(rough_top)),
    }


def bed_distance(data: Path) -> tuple[float, float]:
    """How far the camera of the step blocks is from the bed, and its standard uncertainty, mm.

    From the photographs of a chessboard on the bed. It lies nearly square to the camera, so the
    focal length is known to 6 % only; the board's scale (10.6 px/mm) is known to 0.1 %.
    """
    board = parse_board("chessboard:5x5:5")
    views = [
        detect_board(read_picture(path), board)
        for path in sorted((data / "step-blocks" / "Calibration").glob("Snap_*.jpg"))
    ]
    seen = [v for v in views if len(v.corners)]
    flags = cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_FIX_ASPECT_RATIO
    flags |= cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST
    _, K, _, _, places, spread, _, _ = cv2.calibrateCameraExtended(
        [v.points.astype(np.float32) for v in seen],
        [v.corners.astype(np.float32)[:, None] for v in seen],
        seen[0].size,
        np.array([[1500.0, 0, 320], [0, 1500, 240], [0, 0, 1]]),
        None,
        flags=flags,
    )
    distance = float(np.mean([place[2] for place in places]))
    return distance, distance * float(np.ravel(spread)[1]) / float(K[0, 0])


def height_of(shift: float, known: tuple[float, float], distance: float) -> float:
    """Height above the bed, mm, of what shifts the stripe by ``shift`` px.

    ``known`` is the height and the shift of another block. A point h above the bed is h nearer to
    the camera, so its shift is k h / (distance - h).
    """
    h, s = known
    k = s * (distance - h) / h
    return shift * distance / (k + shift)


def green_board(data: Path, number: int) -> dict[str, float]:
    """One picture without laser-off: the floor line, rows 430-479, and the board."""
    on = read(data / "laser-boards-green" / f"{number}_right.jpg")
    weights = learn_colour(on)
    stripe = detect(project_colour(on, weights, np.uint16), None, StripeSettings(choose="nearest"))
    rows = np.arange(150, 330)
    fit = np.polyfit(rows[stripe.found[rows]], stripe.position[rows][stripe.found[rows]], 2)
    residual = stripe.position[rows] - np.polyval(fit, rows)
    return {
        "rows on the board of 180": float(stripe.found[rows].sum()),
        "rms from a parabola, px": float(np.sqrt(np.nanmean(residual**2))),
        "noise along the stripe, px": roughness(stripe.position[rows]),
    }


def charuco(data: Path, lit: Path) -> dict[str, float]:
    """A pair on two boards: rows with a stripe and its noise."""
    stripe, _ = pair(lit, lit.with_name(lit.name.replace("_laser", "")))
    ambiguous = (stripe.flags & StripeFlag.AMBIGUOUS) > 0
    return {
        "rows found": float(stripe.found.sum()),
        "of": float(len(stripe.position)),
        "ambiguous": float(ambiguous.sum()),
        "noise along the stripe, px": roughness(stripe.position),
    }


def show(title: str, figures: dict[str, float]) -> None:
    """One line of figures."""
    print(f"{title}: " + " · ".join(f"{k} {v:.4g}" for k, v in figures.items()))


def run() -> None:
    """Print all figures."""
    if not DATA.is_dir():
        print("../shared/data is not here: nothing to measure")
        return
    total, on_bust, rim = bust(DATA)
    print(f"ciclop-bust: {total} of 1280 rows ({on_bust} on the bust, {rim} on the table's rim)")
    show("ceramic 5014", ceramic(DATA, "img_5014.jpg", "img_5013.jpg"))
    show("ceramic 5397", ceramic(DATA, "img_5397.jpg", "img_5396.jpg"))
    low, high = (blocks(DATA, f"grey_step_{h}mm") for h in ("3.68", "14"))
    show("step block of 3.68 mm", low)
    show("step block of 14 mm", high)
    distance, spread = bed_distance(DATA)
    height = height_of(low["shift, px"], (14.0, high["shift, px"]), distance)
    print(
        f"step blocks: camera {distance:.0f} ± {spread:.0f} mm above the bed; by the block of 14 mm"
        f" the other is {height:.2f} mm high (3.68)"
    )
    for number in range(6):
        show(f"green board {number}", green_board(DATA, number))
    for lit in sorted((DATA / "charuco-pairs").glob("*_laser.png")):
        show(f"charuco {lit.name[:7]}", charuco(DATA, lit))
