"""Bytes of cameras → pictures, against a packing written another way."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from turnscan.devices import image_of
from turnscan.errors import DeviceGarbled, DeviceRefused


def bit_stream(values: list[int], bits: int) -> bytes:
    """PFNC "p": one long number, the first pixel in its lowest bits."""
    whole = sum(v << bits * k for k, v in enumerate(values))
    return whole.to_bytes(-(-len(values) * bits // 8), "little")


def gev_packed(values: list[int], bits: int) -> bytes:
    """GigE Vision "Packed": two pixels in three bytes, their low bits in the middle one."""
    low = bits - 8
    out = []
    for a, b in zip(values[::2], values[1::2], strict=True):
        out += [a >> low, (a & (1 << low) - 1) | (b & (1 << low) - 1) << 4, b >> low]
    return bytes(out)


@given(st.data(), st.sampled_from([10, 12]), st.sampled_from(["p", "Packed", ""]))
def test_packed_and_unpacked_pixels_come_back(data: st.DataObject, bits: int, packing: str) -> None:
    width, height = 2 * data.draw(st.integers(1, 7)), data.draw(st.integers(1, 5))
    top = 2**bits - 1
    n = width * height
    values = data.draw(st.lists(st.integers(0, top), min_size=n, max_size=n))
    if packing == "":
        raw = np.asarray(values, "<u2").tobytes()
    else:
        raw = bit_stream(values, bits) if packing == "p" else gev_packed(values, bits)
    image = image_of(raw, f"Mono{bits}{packing}", width, height)
    assert image.shape == (height, width)
    assert image.dtype == np.uint16
    exact = np.asarray(values) * 65535 / top
    # Black is 0, clipped is 65535, and between them it is off by less than half a step.
    assert np.abs(image.ravel() - exact).max() < 0.5 * 65535 / top
    assert ((image.ravel() == 65535) == (np.asarray(values) == top)).all()
    assert (np.diff(image.ravel()[np.argsort(values)].astype(int)) >= 0).all()


@pytest.mark.parametrize(
    ("form", "dtype", "shape"),
    [
        ("Mono8", np.uint8, (4, 6)),
        ("Mono16", np.uint16, (4, 6)),
        ("RGB8", np.uint8, (4, 6, 3)),
        ("RGB8Packed", np.uint8, (4, 6, 3)),
        ("BGR8", np.uint8, (4, 6, 3)),
        ("RGBa8", np.uint8, (4, 6, 3)),
        ("BGRa8", np.uint8, (4, 6, 3)),
    ],
)
def test_plain_pixels_come_as_they_are(form: str, dtype: type, shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    want = rng.integers(0, np.iinfo(dtype).max, shape).astype(dtype)
    sent: npt.NDArray[np.generic] = want[..., ::-1] if form.startswith("BGR") else want
    if "a8" in form:
        sent = np.concatenate([sent, np.full((4, 6, 1), 7, dtype)], axis=2)
    data = np.ascontiguousarray(sent)
    for source in (data.tobytes(), data):
        image = image_of(source, form, 6, 4)
        assert np.array_equal(image, want)
        assert image.dtype == dtype
        assert image.flags.c_contiguous
        assert not image.flags.writeable
    buffer = data.copy()
    image = image_of(buffer, form, 6, 4)
    buffer[:] = 0
    assert np.array_equal(image, want), "the picture shares the camera's buffer"


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
@pytest.mark.parametrize(
    ("first", "filters"),
    [("RG", "RGGB"), ("GR", "GRBG"), ("GB", "GBRG"), ("BG", "BGGR")],
)
def test_bayer_gives_each_colour_where_it_was(first: str, filters: str, bits: int) -> None:
    colour = {"R": 3 / 4, "G": 1 / 2, "B": 1 / 5}
    cell = np.array([colour[f] for f in filters]).reshape(2, 2) * (2**bits - 1)
    mosaic = np.tile(cell, (8, 8)).astype("<u2" if bits > 8 else np.uint8)
    image = image_of(mosaic.tobytes(), f"Bayer{first}{bits}", 16, 16)
    assert image.shape == (16, 16, 3)
    top = 255 if bits == 8 else 65535
    assert np.allclose(image / top, [3 / 4, 1 / 2, 1 / 5], atol=1.5 / min(2**bits, 2**16))


def test_missing_bytes_and_strange_formats_have_names() -> None:
    with pytest.raises(DeviceGarbled, match="47 bytes of a 8×6 Mono8 picture of 48"):
        image_of(bytes(47), "Mono8", 8, 6)
    for form in ("YUV422_8", "Coord3D_ABC32f", "RGB16", "Mono9", ""):
        with pytest.raises(DeviceRefused, match="pixels of kind"):
            image_of(bytes(4800), form, 8, 6)


def test_more_bytes_than_needed_are_padding() -> None:
    assert np.array_equal(image_of(bytes(range(60)), "Mono8", 8, 6).ravel(), np.arange(48))
