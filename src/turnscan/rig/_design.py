"""A rig on paper: what it will resolve, before it is built."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.rig import _limits as limits
from turnscan.rig import _paper as paper
from turnscan.rig._camera import Camera
from turnscan.rig._planar import PlanarPoint, planar_pixel, planar_point
from turnscan.rig._pose import Pose
from turnscan.rig._rig import Rig
from turnscan.rig._sheet import LaserSheet

_ANGLES = ("theta", "pan", "step", "look_down")
_SIGNED = ("pan", "offset")
_MAY_BE_ZERO = ("read_noise", "speckle_contrast")
_FULL_STEP = math.radians(1.8)
_STEP_ACCURACY = 0.05
_RMS_CORNER = 0.345
_HUGE = 1e9
_MOST_PIXELS = 100_000


@dataclass(frozen=True)
class Design:
    """A camera, a laser line and a turntable in the paper's arrangement, ideal and uncalibrated.

    Raises InputError naming the value when a number cannot be, or when the camera would not see
    the laser's line between the axis and the projector.
    """

    theta: float
    """Angle of triangulation θ between viewing and illumination, radians; 0 to π/2."""
    distance: float
    """L: horizontal distance from the camera's entrance pupil to the rotation axis, mm."""
    focal: float
    """f, the calibrated principal distance, mm; a lens focused at L has about f(1 + m)."""
    pixel_width: float
    """Pixel pitch along the rows, mm."""
    pixel_height: float
    """Pixel pitch along the columns, mm."""
    columns: int
    """Pixels across the laser line."""
    rows: int
    """Pixels along the laser line."""
    step: float
    """Table angle between two profiles, radians."""
    pan: float = 0.0
    """ψ: the optical axis turned away from the rotation axis, towards the laser, radians."""
    offset: float = 0.0
    """e: the distance by which the laser's line misses the rotation axis, mm."""
    f_number: float = 8.0
    """N of the lens."""
    wavelength: float = 650e-6
    """λ of the laser, mm."""
    stripe_sigma: float = 2.0
    """RMS width of the stripe's profile in the picture, pixels."""
    electrons: float = 8000.0
    """Peak signal of the stripe, electrons."""
    read_noise: float = 3.0
    """Noise of a dark pixel, electrons rms."""
    speckle_contrast: float = 1.0
    """C before the pixel averages: 1 polarised laser light, 0.71 on a depolarising surface."""

    def __post_init__(self) -> None:
        for f in fields(self):
            _check_number(f.name, getattr(self, f.name))
        for name in ("columns", "rows"):
            if getattr(self, name) > _MOST_PIXELS:
                raise _wrong(name, getattr(self, name), f"at most {_MOST_PIXELS}")
        for name, most in (("theta", math.pi / 2), ("pan", math.pi / 2), ("step", math.pi)):
            if not abs(getattr(self, name)) < most:
                raise _wrong(name, getattr(self, name), f"less than {math.degrees(most):g}°")
        for name in ("focal", "offset"):
            if abs(getattr(self, name)) >= self.distance:
                raise _wrong(name, getattr(self, name), f"less than L = {self.distance:g} mm")
        if self.offset <= -self.distance * math.sin(self.theta):
            raise _wrong(
                "offset",
                self.offset,
                "more than −L sin θ, or the laser line lies outside the field of view",
            )
        if not self.r_max > 0:
            raise InputError(
                "the laser line in front of the axis is outside the field of view "
                f"(pan {math.degrees(self.pan):g}°, θ {math.degrees(self.theta):g}°)",
                hint="turn the camera less, or towards the laser",
            )

    # ---- geometry ----------------------------------------------------------------------------

    def point(self, x_ccd: npt.ArrayLike, y_ccd: npt.ArrayLike = 0.0) -> PlanarPoint:
        """Sensor position, mm (x towards the laser, y up) → point on the laser sheet."""
        return planar_point(
            x_ccd, y_ccd, self.theta, self.distance, self.focal, self.pan, self.offset
        )

    def pixel(self, R: npt.ArrayLike, z: npt.ArrayLike = 0.0) -> Floats:
        """Point (R, z) on the laser sheet, mm → (x_ccd, y_ccd), shape (..., 2), mm."""
        return planar_pixel(R, z, self.theta, self.distance, self.focal, self.pan, self.offset)

    @property
    def half_width(self) -> float:
        """Half the sensor's width, mm."""
        return self.columns * self.pixel_width / 2

    @property
    def half_height(self) -> float:
        """Half the sensor's height, mm."""
        return self.rows * self.pixel_height / 2

    @property
    def gamma_max(self) -> float:
        """Equation (8): half the field of view across, radians."""
        return float(paper.gamma_max(self.columns, self.pixel_width, self.focal))

    @property
    def beta_max(self) -> float:
        """Equation (8): the whole field of view along the line, radians."""
        return float(paper.beta_max(self.rows, self.pixel_height, self.focal))

    @property
    def r_max(self) -> float:
        """R at the picture's edge on the laser's side, mm: the largest radius seen all around."""
        return float(self.point(self.half_width).R)

    @property
    def r_min(self) -> float:
        """R at the opposite edge, mm; negative behind the axis, NaN where that view has no end."""
        return float(self.point(-self.half_width).R)

    @property
    def blind_columns(self) -> int:
        """Columns whose viewing rays never meet the laser sheet."""
        x = (np.arange(self.columns) - (self.columns - 1) / 2) * self.pixel_width
        return int(np.isnan(self.point(x).R).sum())

    def depth(self, R: npt.ArrayLike) -> Floats:
        """Distance of (R, ·) from the camera along its optical axis, mm."""
        return np.asarray(self.focal / self.pixel(R, 1.0)[..., 1])

    def visible_height(self, R: npt.ArrayLike) -> Floats:
        """Height of the laser sheet that the sensor's rows see at R, mm."""
        return np.asarray(2 * self.half_height * self.depth(R) / self.focal)

    @property
    def h_max(self) -> float:
        """Height seen at R_max, mm, as Table 1 has it."""
        return float(self.visible_height(self.r_max))

    @property
    def h_max_printed(self) -> float:
        """H_max by the formula the paper prints, with the full angle β_max, mm."""
        return float(self.depth(self.r_max) * np.tan(self.beta_max))

    # ---- resolution --------------------------------------------------------------------------

    def delta_r(self, R: npt.ArrayLike = 0.0) -> Floats:
        """The R that one pixel is worth at radius R, ε dR/dx, mm; NaN outside the picture."""
        x = self.pixel(R)[..., 0]
        seen = np.abs(x) <= self.half_width * (1 + 1e-9)
        return np.where(seen, self.pixel_width * self.point(x).slope, np.nan)

    @property
    def delta_r_rim(self) -> float:
        """The R that one pixel is worth at R_max, mm."""
        return float(self.pixel_width * self.point(self.half_width).slope)

    def delta_z(self, R: npt.ArrayLike = 0.0) -> Floats:
        """The height that one row is worth at radius R, mm."""
        return self.visible_height(R) / self.rows

    @property
    def delta_x(self) -> float:
        """Depth resolution at the axis, mm: equation (7) for ψ = e = 0."""
        return float(self.delta_r()) * math.cos(self.theta)

    @property
    def delta_r_eq5(self) -> float:
        """Equation (5) as printed, mm; it knows neither pan nor offset."""
        return float(paper.delta_r(self.pixel_width, self.theta, self.distance, self.focal))

    @property
    def delta_x_eq6(self) -> float:
        """Equation (6), mm; it knows neither pan nor offset."""
        return float(paper.delta_x(self.pixel_width, self.theta, self.distance, self.focal))

    @property
    def magnification_paper(self) -> float:
        """The paper's m = f/L."""
        return self.focal / self.distance

    @property
    def magnification(self) -> float:
        """The thin lens's m = f/(L − f), with f taken as its focal length."""
        return self.focal / (self.distance - self.focal)

    @property
    def depth_of_field(self) -> float:
        """Half the depth within which defocus stays below one pixel, mm."""
        return limits.depth_of_field(self.f_number, self.pixel_width, self.magnification)

    # ---- noise -------------------------------------------------------------------------------

    @property
    def blur(self) -> float:
        """λN′ with N′ = N(1+m): the speckle's size on the sensor, mm."""
        return self.wavelength * self.f_number * (1 + self.magnification)

    @property
    def camera_noise(self) -> float:
        """Cramér-Rao bound of the stripe's centre in one row, photons and read-out, pixels."""
        return math.hypot(
            limits.photon_bound(self.stripe_sigma, self.electrons),
            limits.readout_bound(self.stripe_sigma, self.electrons, self.read_noise),
        )

    def speckle_noise(self, rows: int = 1) -> float:
        """Speckle limit of the stripe's centre averaged over ``rows`` rows, pixels."""
        sigma = self.stripe_sigma * self.pixel_width
        height = rows * self.pixel_height
        noise = limits.line_speckle(self.speckle_contrast, self.blur, sigma, height)
        return noise / self.pixel_width

    @property
    def dorsch_limit(self) -> float:
        """Dorsch's limit of depth at the axis for this aperture and contrast, mm."""
        aperture = self.focal / (2 * self.f_number)
        sine = aperture / math.hypot(self.distance, aperture)
        return limits.dorsch_limit(self.speckle_contrast, self.wavelength, sine, self.theta)

    @property
    def pixel_contrast(self) -> float:
        """Speckle contrast left in a pixel."""
        full = limits.pixel_speckle_contrast(self.blur, self.pixel_width, self.pixel_height)
        return self.speckle_contrast * full

    def noise(self, R: npt.ArrayLike = 0.0) -> Floats:
        """RMS error of R in one row at radius R, camera and speckle together, mm."""
        return np.asarray(math.hypot(self.camera_noise, self.speckle_noise()) * self.delta_r(R))

    # ---- the table ---------------------------------------------------------------------------

    def sagitta(self, R: npt.ArrayLike) -> Floats:
        """How far a circle of radius R bulges between two profiles, R(1 − cos α/2), mm."""
        return np.asarray(np.asarray(R) * (1 - math.cos(self.step / 2)))

    def corner_cut(self, R: npt.ArrayLike) -> Floats:
        """The most by which a 90° corner at radius R is cut between two profiles, Rα/2, mm."""
        return paper.circumferential_distance(R, self.step) / 2

    def corner_cut_rms(self, R: npt.ArrayLike) -> Floats:
        """The same, rms over where the corner falls between the profiles: 0.345 Rα, mm."""
        return _RMS_CORNER * paper.circumferential_distance(R, self.step)

    def step_error(self, R: npt.ArrayLike) -> Floats:
        """Arc at R of a stepper's usual angle error, 5 % of a step of at most 1.8°, mm."""
        return np.asarray(_STEP_ACCURACY * min(self.step, _FULL_STEP) * np.asarray(R))

    def recommended_step(self, R: float) -> float:
        """The largest whole division of a turn whose arc at R is at most 1.5 stripe widths, rad.

        Below it neighbouring profiles overlap, so that no detail falls between them; the stripe's
        rms width is taken on the object, at the axis.
        """
        width = self.stripe_sigma * self.pixel_width / self.magnification_paper
        return 2 * math.pi / math.ceil(2 * math.pi * R / (1.5 * width))

    @property
    def decorrelation_step(self) -> float:
        """Motion of the surface that brings independent speckle, λN′/m, mm."""
        return self.blur / self.magnification

    # ---- the full model ----------------------------------------------------------------------

    def rig(
        self, *, height: float | None = None, look_down: float = 0.0, both: bool = False
    ) -> Rig:
        """The full rig of this design: distortion-free camera, plane sheet, table.

        The table's x axis points to the camera. ``height`` of the camera above the platter, mm, is
        by default half of H_max, so that the working cylinder stands on the platter. ``look_down``
        (radians) pitches the camera; the closed form holds for 0. The sheet is called ``right``,
        the side of the picture it comes from; ``both`` adds its mirror image, ``left``.
        """
        up = self.h_max / 2 if height is None else height
        if not math.isfinite(up):
            raise _wrong("height", up, "a finite number")
        if not abs(look_down) < math.pi / 2:
            raise _wrong("look_down", look_down, "between −90° and 90°")
        T = looking(np.array([self.distance, 0.0, up]), self.pan, look_down)
        sheets = [_sheet("right", self.theta, self.offset, up, T)]
        if both:
            sheets.append(_sheet("left", -self.theta, -self.offset, up, T))
        camera = Camera(
            width=self.columns,
            height=self.rows,
            fx=self.focal / self.pixel_width,
            fy=self.focal / self.pixel_height,
            cx=(self.columns - 1) / 2,
            cy=(self.rows - 1) / 2,
        )
        return Rig(camera=camera, sheets=tuple(sheets), T_camera_table=T)


def looking(centre: Floats, pan: float, look_down: float) -> Pose:
    """``T_camera_table`` of a camera at ``centre`` that looks along −x, panned and pitched."""
    level = np.array([-math.cos(pan), math.sin(pan), 0.0])
    right = np.array([math.sin(pan), math.cos(pan), 0.0])
    below = np.array([0.0, 0.0, -1.0])
    forward = math.cos(look_down) * level + math.sin(look_down) * below
    down = math.cos(look_down) * below - math.sin(look_down) * level
    R = np.stack([right, down, forward])
    return Pose(R, -R @ centre)


def _sheet(name: str, theta: float, offset: float, up: float, T: Pose) -> LaserSheet:
    normal = np.array([-math.sin(theta), math.cos(theta), 0.0])
    foot = offset * normal + (0.0, 0.0, up)
    return LaserSheet(name, T.turn(normal), T.apply(foot))


def _check_number(name: str, value: float) -> None:
    if not math.isfinite(value):
        raise _wrong(name, value, "a finite number")
    if name in _MAY_BE_ZERO and not 0 <= value <= _HUGE:
        raise _wrong(name, value, f"0 to {_HUGE:g}")
    if name not in (*_SIGNED, *_MAY_BE_ZERO) and not 1 / _HUGE <= value <= _HUGE:
        raise _wrong(name, value, f"a number above 0 and up to {_HUGE:g}")


def _wrong(name: str, value: float, expected: str) -> InputError:
    shown = f"{math.degrees(value):g}°" if name in _ANGLES else f"{value:g}"
    hint = "10° to 60° are usual" if name == "theta" else "check its unit"
    return InputError(f"{name} is {shown}, expected {expected}", hint=hint)
