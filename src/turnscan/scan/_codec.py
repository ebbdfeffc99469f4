"""Pixels ↔ bytes: only the runs above the threshold, or everything; lossless in what is kept.

A payload is one zstd frame. Its content, all little-endian (docs/reference/scan-file.md)::

    runs    uint32 number of runs, uint32 number of pixels, fill value of each channel (of lit,
            then of dark where the frame has its own),
            uint32 runs of each line, uint32 first pixel of each run, uint32 length of each run,
            lit pixels, and dark pixels where the frame has its own
    full    lit pixels, and dark pixels where the frame has its own

Lines are image rows for a vertical stripe and image columns for a horizontal one. Pixels stand
channel by channel (red and blue less green), as differences from the pixel before, all modulo
2^bits, 16-bit ones as all low bytes and then all high bytes: that is what zstd packs best.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import zstandard

from turnscan.arrays import Bools, Bytes, Image
from turnscan.errors import LimitExceeded, ScanCorrupt
from turnscan.runs import Runs
from turnscan.scan._plan import Frame, ScanPlan
from turnscan.scan._signal import (
    Pixels,
    above,
    sample,
    sampled_signal,
    signal_of,
    statistics,
)

Dark = Literal["own", "background", "none"]
Project = Callable[[Image], Pixels]
"""Colour pixels (H, W, 3) → unsigned signal (H, W), linear up to a shift; applied to the kept
pixels only, as one long line."""

Sums = Callable[[Bytes], Bytes]
"""Steps (n,) → the sum of each and all before it, modulo 256."""

_LEVEL = 1
_U32 = np.dtype("<u4")


class Background:
    """A picture without the laser that many frames share, as stored and as it is shown."""

    def __init__(self, stored: Image, project: Project | None) -> None:
        """``project`` is None where pixels are shown as they are stored."""
        self.project = project
        self.shown: Pixels = stored if project is None else project(stored)
        self._turned: Pixels | None = None

    def raised(self, fill: Pixels) -> Pixels:
        """A new picture of the background, brighter by ``fill`` (C,) modulo 2^bits."""
        if not fill.any():
            return self.shown.copy()
        top = np.iinfo(self.shown.dtype).max
        picture = np.clip(self.shown + self._added(fill), 0, top)
        return np.asarray(picture.astype(self.shown.dtype))

    def above(self, fill: Pixels) -> int:
        """By how much `raised` is brighter, of pictures of one channel as they are shown."""
        return int(self._added(fill).reshape(-1)[0])

    def lines(self, orientation: Literal["vertical", "horizontal"]) -> Image:
        """The picture as it is shown, laid so that lines are rows."""
        if orientation == "vertical":
            return self.shown
        if self._turned is None:
            self._turned = np.ascontiguousarray(self.shown.T)
        return self._turned

    def _added(self, fill: Pixels) -> Pixels:
        """(C,) or, where pixels are projected, one number: signed levels."""
        added: Pixels = fill.astype(f"i{fill.dtype.itemsize}").astype(np.int32)
        if self.project is None:
            return added
        two = np.stack([np.maximum(added, 0), np.maximum(-added, 0)]).astype(fill.dtype)
        up, down = self.project(two.reshape(1, 2, 3))[0].astype(np.int32)
        return np.asarray(up - down)


def encode(
    lit: Image, dark: Image | None, own: bool, threshold: float, plan: ScanPlan
) -> tuple[bytes, float]:
    """Payload of a frame, and the share of its pixels that it holds.

    Of a sparse scan those are kept where its signal is above ``threshold``; ``dark`` is kept too if
    ``own``.
    """
    pictures = [lit, dark] if own and dark is not None else [lit]
    share = 1.0
    if plan.keep == "full":
        body = [_squeeze(_planes(p)) for p in pictures]
    else:
        bright = above(lit, dark, plan.weights, threshold)
        lines = bright if plan.orientation == "vertical" else bright.T
        counts, starts, lengths = find_runs(lines, plan.margin)
        index = _indices(counts, starts, lengths, lines.shape, plan)
        share = len(index) / lines.size
        body = [
            np.array([len(starts), len(index)], _U32).tobytes(),
            _fill(lit, dark, own).tobytes(),
            *(a.astype(_U32).tobytes() for a in (counts, starts, lengths)),
            *(_squeeze(_planes(p)[:, index]) for p in pictures),
        ]
    return zstandard.ZstdCompressor(level=_LEVEL).compress(b"".join(body)), share


def packed_size(frame: Frame, plan: ScanPlan) -> int:
    """Bytes that the pixels of a frame, with its own dark picture or none, would take in a scan."""
    level = statistics(sampled_signal(frame.lit, frame.dark, plan.weights)).level
    own = frame.dark is not None
    return len(encode(frame.lit, frame.dark, own, level + plan.threshold, plan)[0])


def decode(
    payload: bytes,
    plan: ScanPlan,
    dark: Dark,
    background: Background | None,
    project: Project | None,
    where: str,
) -> tuple[Pixels, Pixels | None]:
    """Lit and dark pictures from a payload; with ``project``, of the projected signal.

    Raises ScanCorrupt naming ``where``.
    """
    body = _unpacked(payload, plan, dark == "own", where)
    if plan.keep == "full":
        return _decode_full(body, plan, dark, background, project, where)
    return _decode_runs(body, plan, dark, background, project, where)


def find_runs(bright: Bools, margin: int) -> tuple[Pixels, Pixels, Pixels]:
    """Runs of pixels to keep in each line of pictures that are ``bright`` (n, m) there.

    A pixel is kept within ``margin`` of a bright one. Returns runs per line
    (n,), first pixel and length of each run.
    """
    n, m = bright.shape
    place = np.flatnonzero(bright)
    line, column = np.divmod(place, m)
    first, after = np.maximum(column - margin, 0), np.minimum(column + margin + 1, m)
    new = np.ones(len(place), bool)
    new[1:] = (line[1:] != line[:-1]) | (first[1:] > after[:-1])
    begin = np.flatnonzero(new)
    last = np.append(begin[1:], len(place)) - 1 if len(place) else begin
    counts = np.bincount(line[begin], minlength=n)
    return counts, first[begin], after[last] - first[begin]


def _indices(
    counts: Pixels, starts: Pixels, lengths: Pixels, shape: tuple[int, ...], plan: ScanPlan
) -> npt.NDArray[np.int64]:
    """Flat index, in the picture, of every kept pixel in the order of the runs."""
    n, m = shape
    line = np.repeat(np.arange(n), counts)
    ends = np.cumsum(lengths)
    within = np.arange(int(ends[-1]) if len(ends) else 0) - np.repeat(ends - lengths, lengths)
    if plan.orientation == "vertical":
        return np.asarray(np.repeat(line * m + starts, lengths) + within, np.int64)
    return np.asarray(np.repeat(line + starts * n, lengths) + within * n, np.int64)


def decode_runs(
    payload: bytes,
    plan: ScanPlan,
    dark: Dark,
    background: Background | None,
    project: Project | None,
    where: str,
) -> Runs:
    """The runs that a payload of a sparse scan keeps; of a colour scan, projected.

    `decode` makes whole pictures of the same. Raises ScanCorrupt naming ``where``.
    """
    from turnscan.scan._codec_kernels import running_sums

    body = _unpacked(payload, plan, dark == "own", where)
    kept = _kept(body, plan, dark, project, where, running_sums)
    n = plan.channels
    ground = background.above(kept.fill) if background else _level(kept.fill[:n], project)
    return Runs(
        kept.counts,
        kept.starts,
        kept.lengths,
        kept.values[0],
        kept.values[1] if dark == "own" else None,
        ground,
        _level(kept.fill[n:], project) if dark == "own" else 0,
        None if background is None else background.lines(plan.orientation),
    )


@dataclass(frozen=True, eq=False)
class _Kept:
    """What a sparse payload holds."""

    fill: Pixels
    """(C,) of lit, or (2C,) of lit and dark: what stands where nothing is kept."""
    counts: npt.NDArray[np.int64]
    starts: npt.NDArray[np.int64]
    lengths: npt.NDArray[np.int64]
    values: list[Pixels]
    """Pixels of all runs: of lit, and of dark where the frame has its own."""


def _kept(
    body: memoryview, plan: ScanPlan, dark: Dark, project: Project | None, where: str,
    summed: Sums | None = None,
) -> _Kept:  # fmt: skip
    dtype, channels = np.dtype(plan.dtype), plan.channels
    lines, across = _laid_shape(plan)
    pictures = 2 if dark == "own" else 1
    head = 8 + pictures * channels * dtype.itemsize
    if len(body) < head + 4 * lines:
        raise ScanCorrupt(f"{where}: its table of runs is truncated")
    runs, count = (int(v) for v in np.frombuffer(body, _U32, 2))
    fill = np.frombuffer(body, dtype.newbyteorder("<"), pictures * channels, 8).astype(dtype)
    table = 4 * (lines + 2 * runs)
    if len(body) != head + table + pictures * count * channels * dtype.itemsize:
        raise ScanCorrupt(f"{where}: {len(body)} bytes do not hold {runs} runs, {count} pixels")
    numbers = np.frombuffer(body, _U32, lines + 2 * runs, head).astype(np.int64)
    counts, starts, lengths = np.split(numbers, [lines, lines + runs])
    if counts.sum() != runs or lengths.sum() != count or (starts + lengths > across).any():
        raise ScanCorrupt(f"{where}: its runs do not fit the picture")
    values = [
        _spread(body[head + table :], i, count, channels, dtype, project, summed)
        for i in range(pictures)
    ]
    return _Kept(fill, counts, starts, lengths, values)


def _laid_shape(plan: ScanPlan) -> tuple[int, int]:
    """Lines, and pixels across them."""
    shape = (plan.height, plan.width)
    return shape if plan.orientation == "vertical" else shape[::-1]


def _decode_runs(
    body: memoryview,
    plan: ScanPlan,
    dark: Dark,
    background: Background | None,
    project: Project | None,
    where: str,
) -> tuple[Pixels, Pixels | None]:
    channels = plan.channels
    kept = _kept(body, plan, dark, project, where)
    index = _indices(kept.counts, kept.starts, kept.lengths, _laid_shape(plan), plan)
    lit = _ground(plan, kept.fill[:channels], background, project)
    _put(lit, index, kept.values[0])
    if dark != "own":
        return lit, None if background is None else background.shown
    off = _ground(plan, kept.fill[channels:], None, project)
    _put(off, index, kept.values[1])
    return lit, off


def _decode_full(
    body: memoryview,
    plan: ScanPlan,
    dark: Dark,
    background: Background | None,
    project: Project | None,
    where: str,
) -> tuple[Pixels, Pixels | None]:
    dtype, count = np.dtype(plan.dtype), plan.width * plan.height
    pictures = 2 if dark == "own" else 1
    if len(body) != pictures * count * plan.channels * dtype.itemsize:
        raise ScanCorrupt(f"{where}: {len(body)} bytes are not {pictures} pictures")
    out = [
        _spread(body, i, count, plan.channels, dtype, project).reshape(
            (plan.height, plan.width) + ((3,) if plan.channels == 3 and project is None else ())
        )
        for i in range(pictures)
    ]
    if dark == "own":
        return out[0], out[1]
    return out[0], None if background is None else background.shown


def _unpacked(payload: bytes, plan: ScanPlan, own: bool, where: str) -> memoryview:
    """Content of the payload; its size is checked before it is unpacked."""
    pixels = plan.width * plan.height
    each = plan.channels * np.dtype(plan.dtype).itemsize * (2 if own else 1)
    most = pixels * (each + 8) + 4 * max(plan.width, plan.height) + 64
    try:
        size = zstandard.frame_content_size(payload)
        if size < 0:
            raise ScanCorrupt(f"{where}: its payload does not say its size")
        if size > most:
            raise LimitExceeded(f"{where}: unpacks to {size} bytes; at most {most} are possible")
        return memoryview(zstandard.ZstdDecompressor().decompress(payload))
    except zstandard.ZstdError as e:
        raise ScanCorrupt(f"{where}: its payload does not unpack ({e})") from None


def _planes(picture: Pixels) -> Pixels:
    """(H, W) or (H, W, C) → (C, H·W)."""
    planes: Pixels = picture.reshape(picture.shape[0] * picture.shape[1], -1).T
    return np.ascontiguousarray(planes)


def _squeeze(planes: Pixels) -> bytes:
    """(C, N) pixels → bytes that pack well: differences, low bytes before high bytes."""
    if len(planes) == 3:
        planes = planes - np.stack([planes[1], np.zeros_like(planes[1]), planes[1]])
    step = planes.copy()
    step[:, 1:] -= planes[:, :-1]
    low_high = step.astype(step.dtype.newbyteorder("<")).reshape(-1).view(np.uint8)
    return bytes(low_high.reshape(-1, step.dtype.itemsize).T.tobytes())


def _spread(
    body: memoryview, which: int, count: int, channels: int, dtype: Any, project: Project | None,
    summed: Sums | None = None,
) -> Pixels:  # fmt: skip
    """Undo `_squeeze` for picture number ``which``: (N,), (N, 3) or, projected, (N,).

    ``summed`` makes grey pixels of 8 bits, where that is compiled: NumPy takes several times as
    long.
    """
    size = count * channels
    raw = np.frombuffer(body, np.uint8, size * dtype.itemsize, which * size * dtype.itemsize)
    if dtype.itemsize == 2:
        raw = np.ascontiguousarray(raw.reshape(2, -1).T).reshape(-1).view("<u2")
    if summed is not None and channels == 1 and dtype.itemsize == 1:
        return summed(raw)
    values = np.cumsum(raw.reshape(channels, count), axis=1, dtype=dtype)
    if channels == 1:
        return np.asarray(values[0])
    values[::2] += values[1]
    pixels = np.ascontiguousarray(values.T)
    return pixels if project is None else project(pixels[np.newaxis])[0]


def _fill(lit: Image, dark: Image | None, own: bool) -> Pixels:
    """What stands where nothing is kept, so that the signal there is its own median.

    Values of the channels: of lit where there is no dark, of lit and of dark where that is the
    frame's own, and of lit − dark, modulo 2^bits, where dark is the shared background.
    """
    bits = lit.dtype.newbyteorder("<")
    if dark is None:
        return _medians(lit).astype(bits)
    added = _medians(signal_of(sample(lit), sample(dark), None)).astype(np.int64)
    if not own:
        return added.astype(bits)
    off = _medians(dark).astype(np.int64)
    top = np.iinfo(lit.dtype).max
    return np.concatenate((np.clip(off + added, 0, top), off)).astype(bits)


def _medians(picture: Pixels) -> Pixels:
    return np.asarray(np.median(sample(picture)[:, 0], axis=0))


def _ground(
    plan: ScanPlan, fill: Pixels, background: Background | None, project: Project | None
) -> Pixels:
    """Picture, writeable, of what stands where nothing is kept."""
    if background is not None:
        return background.raised(fill)
    if plan.channels == 1:
        return np.full((plan.height, plan.width), fill[0])
    pixel = fill.reshape(1, 1, 3)
    if project is not None:
        return np.full((plan.height, plan.width), project(pixel)[0, 0])
    return np.broadcast_to(pixel, plan.shape).copy()


def _level(fill: Pixels, project: Project | None) -> int:
    """What `_ground` is everywhere in pictures of one channel as they are shown."""
    return int(fill[0]) if project is None else int(project(fill.reshape(1, 1, 3))[0, 0])


def _put(picture: Pixels, index: npt.NDArray[np.int64], values: Pixels) -> None:
    picture.reshape(-1, *picture.shape[2:])[index] = values
