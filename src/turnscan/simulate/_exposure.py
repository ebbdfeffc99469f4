"""One exposure: expected photo-electrons → a digital picture, by the sensor's readout and the
camera's processor."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Image
from turnscan.simulate._random import seed64
from turnscan.simulate._sensor import Sensor


def expose(electrons: npt.ArrayLike, sensor: Sensor, seed: int, seconds: float = 0.0) -> Image:
    """Take one picture of the expected photo-electrons.

    ``electrons`` is (H, W), or (H, W, 3) for a Bayer sensor: what each pixel would collect behind
    a red, green and blue filter. ``seconds`` is the exposure, for the dark current. The result is
    uint8, or uint16 above 8 bits, of shape (H, W), or (H, W, 3) from a Bayer sensor; the same
    arguments always give the same picture.

    Raises ValueError for a wrong shape, a negative or non-finite number of electrons or seconds.
    """
    from turnscan.simulate import _readout

    if not (np.isfinite(seconds) and seconds >= 0):
        raise ValueError(f"expose: {seconds} seconds, expected 0 or more")
    light = _checked(electrons, sensor)
    shot = seed64(seed, 1)
    if sensor.bayer:
        light = _readout.mosaic(light, _filter_of_site(sensor.bayer))
    if sensor.jitter > 0:
        light = _readout.jittered(light, sensor.jitter, seed64(seed, 2))
    raw = _readout.raw(light, sensor, shot, seed64(sensor.serial, 3), seconds)
    return _processed(raw, sensor)


def _checked(electrons: npt.ArrayLike, sensor: Sensor) -> npt.NDArray[np.float32]:
    light = np.ascontiguousarray(electrons, dtype=np.float32)
    colour = light.ndim == 3 and light.shape[2] == 3 and bool(sensor.bayer)
    if not (light.ndim == 2 or colour) or 0 in light.shape:
        wanted = "(H, W, 3) or (H, W)" if sensor.bayer else "(H, W)"
        raise ValueError(f"expose: electrons of shape {light.shape}, expected {wanted}")
    # Two reductions, no temporary: NaN fails the comparison.
    if not (light.min() >= 0 and light.max() < np.inf):
        raise ValueError("expose: electrons must be finite and not negative")
    return light


def _filter_of_site(pattern: str) -> npt.NDArray[np.int64]:
    """(2, 2) which of red, green, blue lies over a pixel of even/odd row and column."""
    return np.array(["RGB".index(letter) for letter in pattern]).reshape(2, 2)


def _processed(raw: npt.NDArray[np.uint16], sensor: Sensor) -> Image:
    """Demosaic, gamma, bits, JPEG: what the camera's processor makes of the converter's numbers."""
    picture: npt.NDArray[np.uint16] = raw
    if sensor.bayer:
        picture = _demosaiced(raw, sensor.bayer)
    if sensor.gamma != 1.0 or sensor.converter_levels != sensor.levels:
        picture = _tone(sensor)[picture]
    if sensor.bits > 8:
        return picture
    image = picture.astype(np.uint8)
    return _through_jpeg(image, sensor.jpeg_quality) if sensor.jpeg_quality else image


def _tone(sensor: Sensor) -> npt.NDArray[np.uint16]:
    """The table from converter steps to grey levels; the black level stays where it is."""
    top = sensor.converter_levels - 1
    steps = np.arange(sensor.converter_levels)
    linear = np.maximum(steps - sensor.black, 0.0) / (top - sensor.black)
    black = sensor.black * (sensor.levels - 1) / top
    grey = black + (sensor.levels - 1 - black) * linear ** (1.0 / sensor.gamma)
    return np.asarray(np.floor(grey + 0.5), dtype=np.uint16)


def _demosaiced(raw: npt.NDArray[np.uint16], pattern: str) -> npt.NDArray[np.uint16]:
    import cv2

    # OpenCV names a pattern by the second row's second and third pixel: RGGB is its "BG".
    code = {
        "RGGB": cv2.COLOR_BayerBG2RGB,
        "BGGR": cv2.COLOR_BayerRG2RGB,
        "GRBG": cv2.COLOR_BayerGB2RGB,
        "GBRG": cv2.COLOR_BayerGR2RGB,
    }[pattern]
    return np.asarray(cv2.cvtColor(raw, code), dtype=np.uint16)


def _through_jpeg(image: npt.NDArray[np.uint8], quality: int) -> npt.NDArray[np.uint8]:
    import cv2

    colour = image.ndim == 3
    page = image[..., ::-1] if colour else image
    _, code = cv2.imencode(".jpg", np.ascontiguousarray(page), [cv2.IMWRITE_JPEG_QUALITY, quality])
    flags = cv2.IMREAD_COLOR if colour else cv2.IMREAD_GRAYSCALE
    back = np.asarray(cv2.imdecode(code, flags))
    return np.ascontiguousarray(back[..., ::-1] if colour else back, dtype=np.uint8)
