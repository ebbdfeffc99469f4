"""Pictures made elsewhere: which files, in which order, and their pixels exactly as stored."""

from __future__ import annotations

import glob
import io
import math
import os
import re
import struct
import warnings
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from turnscan.arrays import Image
from turnscan.errors import FormatError, InputError, LimitExceeded
from turnscan.scan._limits import PICTURE_BYTES, check_pixels
from turnscan.scan._matroska import bytes_missing

Pixels = TypeVar(
    "Pixels", np.ndarray[Any, np.dtype[np.uint8]], np.ndarray[Any, np.dtype[np.uint16]]
)

PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")
VIDEO_SUFFIXES = (".avi", ".mp4", ".mov", ".mkv", ".m4v", ".webm", ".wmv", ".mpg", ".mpeg")
_FORMATS = ("PNG", "JPEG", "TIFF", "BMP")
_PIXELS_PER_BYTE = 10_000
"""No picture compresses further than this: a header that claims more is lying."""


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sort key that counts the digits in a name as numbers: step2 before step10."""
    parts = re.split(r"(\d+)", name.casefold())
    return tuple((0, int(p), "") if i % 2 else (1, 0, p) for i, p in enumerate(parts))


def list_pictures(spec: str | Path) -> list[Path]:
    """Pictures of a folder, of a glob like ``pics/left_*.png``, or the one file named.

    Returns PNG, JPEG, TIFF and BMP files in natural order (step_num2 before step_num10); hidden
    files and other types are passed over, sub-folders are not entered.
    Raises InputError where there is nothing, or nothing that is a picture.
    """
    path = Path(spec).expanduser()
    if path.is_dir():
        found, kind = list(path.iterdir()), "folder"
    elif path.exists():
        found, kind = [path], "file"
    elif glob.has_magic(str(path)):
        found, kind = [Path(p) for p in glob.glob(str(path))], "pattern"
    else:
        raise InputError(f"{spec}: no such file or folder", hint="check the path")
    pictures = [
        p
        for p in found
        if p.suffix.lower() in PICTURE_SUFFIXES and not p.name.startswith(".") and p.is_file()
    ]
    if not pictures:
        have = (
            f"{len(found)} other entries, such as {sorted(found)[0].name}" if found else "nothing"
        )
        raise InputError(
            f"{spec}: no picture in this {kind}, which holds {have}",
            hint="give a folder, a pattern or a file of PNG, JPEG, TIFF or BMP pictures",
        )
    return sorted(pictures, key=lambda p: (natural_key(p.name), p.name))


def picture_numbers(names: list[str]) -> list[int] | None:
    """Number of each picture in a series: the one number in which the names differ.

    ``step_num1.jpg, step_num3.jpg`` gives [1, 3]. Returns None where the names are not one series
    (they differ in text, in more than one number, or not at all).
    """
    parts = [re.split(r"(\d+)", Path(n).stem) for n in names]
    if len(names) < 2 or len({tuple(p[::2]) for p in parts}) != 1:
        return None
    columns = [[int(p[i]) for p in parts] for i in range(1, len(parts[0]), 2)]
    varying = [c for c in columns if len(set(c)) > 1]
    if len(varying) != 1 or len(set(varying[0])) != len(names):
        return None
    return varying[0]


def numbers_apart(numbers: Iterable[int], first: int) -> int:
    """How far the numbers of neighbouring steps lie apart, counted from ``first``.

    The greatest common divisor: of 0, 4, 6 steps are 2 apart, and those of 2 are missing.
    """
    return math.gcd(*(n - first for n in numbers)) or 1


def read_picture(path: str | Path) -> Image:
    """Pixels of one picture exactly as stored, read-only.

    Returns (H, W) for grey and (H, W, 3) in the order red, green, blue for colour; uint8, or uint16
    for 16-bit PNG and TIFF, to the bit. Palettes become colour, transparency is dropped, and only
    the first page of a multi-page file is read. An EXIF rotation is **not** applied: the pixels
    must stay where the camera's calibration has them.

    Raises FormatError for a file that is damaged, truncated or no such picture, and LimitExceeded,
    before anything is allocated, for one that is too large.
    """
    from PIL import Image as Pillow
    from PIL import UnidentifiedImageError

    path = Path(path)
    data = _bytes(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what matters is checked here and raised
            with Pillow.open(io.BytesIO(data), formats=_FORMATS) as picture:
                width, height = picture.size
                _check_size(width, height, len(data), path)
                picture.load()
                if _sixteen_bit_colour(picture, data):
                    return _frozen(_decode_sixteen(data, path))
                return _frozen(_pixels(picture, path))
    except Pillow.DecompressionBombError as e:
        raise LimitExceeded(f"{path}: {e}", hint="crop or shrink the picture") from None
    except UnidentifiedImageError:
        start = data[:12].decode("latin-1", "replace").encode("unicode_escape").decode()
        raise FormatError(
            f"{path}: not a PNG, JPEG, TIFF or BMP picture (it begins with “{start}”)",
            hint="remove or convert this file",
        ) from None
    except _BROKEN as e:
        if isinstance(e, InputError):
            raise
        raise FormatError(
            f"{path}: damaged or truncated ({e})", hint="copy the picture again or remove it"
        ) from None


_BROKEN = (
    OSError,
    SyntaxError,
    ValueError,
    TypeError,
    LookupError,
    EOFError,
    ArithmeticError,
    AttributeError,
    RuntimeError,
    struct.error,
    zlib.error,
)
"""What decoders are known to raise on damaged files."""


_COUNTED = (".avi", ".mp4", ".mov", ".m4v")
"""Videos of these kinds hold the number of their frames; of others it is an estimate (MKV and WebM
tell how long they are)."""
_ALL = 0.9
"""Of it: so many are all, as some cameras count frames that they have dropped."""
_CUT_HINT = "copy the video again, or convert what is good of it to pictures, as PNG"
_SILENT = "-8"
"""FFmpeg's level of messages at which it prints nothing."""


def is_video(path: str | Path) -> bool:
    """Whether a name ends like a video's."""
    return Path(path).suffix.lower() in VIDEO_SUFFIXES


def read_video(path: str | Path) -> Iterator[Image]:
    """Frames of a video in order, each (H, W, 3) uint8 in the order red, green, blue.

    Raises InputError for a missing file, FormatError where it does not open, holds no frame or ends
    long before the last one that it declares, and LimitExceeded for frames that are too large.
    """
    # The decoder tells the terminal of a damaged file, in its own words.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", _SILENT)
    import cv2

    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such video", hint="check the path")
    video = cv2.VideoCapture(str(path))
    try:
        if not video.isOpened():
            raise FormatError(
                f"{path}: no video that OpenCV can open", hint="convert it to pictures, as PNG"
            )
        width = int(video.get(cv2.CAP_PROP_FRAME_WIDTH))
        height = int(video.get(cv2.CAP_PROP_FRAME_HEIGHT))
        check_pixels(width, height, str(path))
        declared = int(video.get(cv2.CAP_PROP_FRAME_COUNT))
        count = 0
        while True:
            good, frame = video.read()
            if not good:
                break
            count += 1
            yield _frozen(np.asarray(frame[..., ::-1]))
        if count == 0:
            raise FormatError(f"{path}: a video without a single readable frame")
        if path.suffix.lower() in _COUNTED and count < _ALL * declared:
            raise FormatError(
                f"{path}: {declared} frames are declared, {count} can be read: it is cut off or "
                "damaged",
                hint=_CUT_HINT,
            )
        missing = bytes_missing(path)
        if missing:
            raise FormatError(
                f"{path}: {missing} bytes are missing at its end, {count} frames can be read: it "
                "is cut off",
                hint=_CUT_HINT,
            )
    finally:
        video.release()


def _bytes(path: Path) -> bytes:
    if not path.is_file():
        raise InputError(f"{path}: no such picture", hint="check the path")
    size = path.stat().st_size
    if size > PICTURE_BYTES:
        raise LimitExceeded(f"{path}: {size} bytes; a picture has at most {PICTURE_BYTES}")
    if size == 0:
        raise FormatError(f"{path}: an empty file", hint="copy the picture again or remove it")
    return path.read_bytes()


def _check_size(width: int, height: int, size: int, path: Path) -> None:
    check_pixels(width, height, str(path))
    if width * height > 1_000_000 + _PIXELS_PER_BYTE * size:
        raise FormatError(
            f"{path}: is declared as {width}×{height}, but has only {size} bytes",
            hint="copy the picture again or remove it",
        )


def _sixteen_bit_colour(picture: Any, data: bytes) -> bool:
    """Whether the file has 16 bits a channel in colour, which Pillow would cut to 8."""
    if picture.format == "PNG":
        return data[24] == 16 and data[25] in (2, 4, 6)
    if picture.format == "TIFF":
        bits = picture.tag_v2.get(258, (1,))
        return len(bits) > 1 and max(bits) == 16
    return False


def _decode_sixteen(data: bytes, path: Path) -> np.ndarray[Any, Any]:
    import cv2

    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as e:
        raise FormatError(f"{path}: damaged ({e.err})", hint="convert it to 16-bit PNG") from None
    if pixels is None or pixels.dtype != np.uint16:
        raise FormatError(f"{path}: not readable with 16 bits", hint="convert it to 16-bit PNG")
    if pixels.ndim == 2:
        return np.asarray(pixels)
    if pixels.shape[2] == 2:
        return np.asarray(pixels[..., 0])
    return np.asarray(pixels[..., 2::-1])


def _pixels(picture: Any, path: Path) -> np.ndarray[Any, Any]:
    mode = picture.mode
    if mode in ("L", "RGB") or mode.startswith("I;16"):
        return np.asarray(picture)
    if mode in ("1", "LA"):
        return np.asarray(picture.convert("L"))
    if mode in ("P", "PA", "RGBA", "RGBX", "YCbCr"):
        return np.asarray(picture.convert("RGB"))
    raise FormatError(
        f"{path}: pixels of kind {mode!r}", hint="convert it to grey or RGB with 8 or 16 bits"
    )


def _frozen(pixels: np.ndarray[Any, Any]) -> Image:
    if pixels.dtype.itemsize == 2:
        return _locked(np.ascontiguousarray(pixels, dtype=np.uint16))
    return _locked(np.ascontiguousarray(pixels, dtype=np.uint8))


def _locked(pixels: Pixels) -> Pixels:
    pixels.flags.writeable = False
    return pixels
