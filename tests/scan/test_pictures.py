"""Pictures are read to the bit, in natural order; every broken one is a named error."""

from __future__ import annotations

import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow

from turnscan.errors import FormatError, InputError, LimitExceeded
from turnscan.scan import list_pictures, numbers_apart, picture_numbers, read_picture, read_video
from turnscan.scan._matroska import bytes_missing


def _png(path: Path, pixels: np.ndarray) -> Path:
    Pillow.fromarray(pixels).save(path)
    return path


def _sixteen(path: Path, pixels: np.ndarray) -> Path:
    import cv2

    assert cv2.imwrite(str(path), pixels[..., ::-1] if pixels.ndim == 3 else pixels)
    return path


def test_natural_order_and_only_pictures(tmp_path: Path) -> None:
    for name in ("step_num10.png", "step_num2.PNG", "step_num1.jpeg", "notes.txt", ".hidden.png"):
        (tmp_path / name).write_bytes(b"x")
    (tmp_path / "folder.png").mkdir()
    want = ["step_num1.jpeg", "step_num2.PNG", "step_num10.png"]
    assert [p.name for p in list_pictures(tmp_path)] == want
    assert [p.name for p in list_pictures(f"{tmp_path}/step*1*")] == [want[0], want[2]]
    assert list_pictures(tmp_path / want[0]) == [tmp_path / want[0]]


def test_a_folder_with_brackets_is_not_a_pattern(tmp_path: Path) -> None:
    folder = tmp_path / "scan[1]"
    folder.mkdir()
    (folder / "a.png").write_bytes(b"x")
    assert list_pictures(folder) == [folder / "a.png"]


def test_missing_and_empty_are_said_plainly(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file or folder"):
        list_pictures(tmp_path / "nowhere")
    with pytest.raises(InputError, match="which holds nothing"):
        list_pictures(tmp_path)
    (tmp_path / "readme.txt").write_text("x")
    with pytest.raises(InputError, match=r"such as readme\.txt"):
        list_pictures(tmp_path)
    with pytest.raises(InputError, match="pattern"):
        list_pictures(f"{tmp_path}/*.png")


@pytest.mark.parametrize(
    ("names", "numbers"),
    [
        (["s1.png", "s3.png", "s10.png"], [1, 3, 10]),
        (["d2024_s1_left.png", "d2024_s2_left.png"], [1, 2]),
        (["a.png", "b.png"], None),
        (["s1.png"], None),
        (["s1_2.png", "s2_3.png"], None),
        (["s1.png", "s01.png"], None),
    ],
)
def test_picture_numbers(names: list[str], numbers: list[int] | None) -> None:
    assert picture_numbers(names) == numbers


@pytest.mark.parametrize("suffix", ["png", "tif"])
@pytest.mark.parametrize("shape", [(7, 5), (7, 5, 3)])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_lossless_pictures_come_back_to_the_bit(
    tmp_path: Path, suffix: str, shape: tuple[int, ...], dtype: type
) -> None:
    rng = np.random.default_rng(3)
    pixels = rng.integers(0, np.iinfo(dtype).max, shape, dtype=dtype, endpoint=True)
    write = _png if dtype is np.uint8 else _sixteen
    got = read_picture(write(tmp_path / f"a.{suffix}", pixels))
    assert got.dtype == dtype
    np.testing.assert_array_equal(got, pixels)
    assert not got.flags.writeable


def test_palette_alpha_and_one_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    rgba = rng.integers(0, 256, (6, 8, 4), dtype=np.uint8)
    np.testing.assert_array_equal(read_picture(_png(tmp_path / "a.png", rgba)), rgba[..., :3])
    few = Pillow.fromarray(rgba[..., :3]).quantize(8)
    few.save(tmp_path / "p.png")
    np.testing.assert_array_equal(read_picture(tmp_path / "p.png"), np.asarray(few.convert("RGB")))
    Pillow.fromarray(rgba[..., 0] > 99).save(tmp_path / "b.png")
    assert set(np.unique(read_picture(tmp_path / "b.png"))) == {0, 255}
    deep = rng.integers(0, 65536, (6, 8, 4), dtype=np.uint16)
    import cv2

    cv2.imwrite(str(tmp_path / "d.png"), deep)
    np.testing.assert_array_equal(read_picture(tmp_path / "d.png"), deep[..., 2::-1])


def test_exif_rotation_is_not_applied(tmp_path: Path) -> None:
    picture = Pillow.fromarray(np.zeros((4, 9), np.uint8))
    exif = picture.getexif()
    exif[0x0112] = 6
    picture.save(tmp_path / "a.jpg", exif=exif)
    assert read_picture(tmp_path / "a.jpg").shape == (4, 9)


@pytest.mark.parametrize("suffix", ["jpg", "png", "bmp", "tif"])
def test_a_picture_cut_anywhere_is_never_read(tmp_path: Path, suffix: str) -> None:
    rng = np.random.default_rng(5)
    whole = tmp_path / f"whole.{suffix}"
    Pillow.fromarray(rng.integers(0, 256, (40, 60, 3), dtype=np.uint8)).save(whole)
    data = whole.read_bytes()
    cut = tmp_path / f"cut.{suffix}"
    for length in {0, 1, 10, 30, *range(60, len(data) - 40, len(data) // 23)}:
        cut.write_bytes(data[:length])
        with pytest.raises(FormatError, match=f"cut.{suffix}"):
            read_picture(cut)


def test_text_called_png(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_text("hello, I am text")
    with pytest.raises(FormatError, match=r"not a PNG.*hello, I am"):
        read_picture(tmp_path / "a.png")


def test_floating_point_pictures_are_refused_by_name(tmp_path: Path) -> None:
    Pillow.fromarray(np.zeros((3, 3), np.float32)).save(tmp_path / "f.tif")
    with pytest.raises(FormatError, match="kind 'F'"):
        read_picture(tmp_path / "f.tif")


def _liar(width: int, height: int) -> bytes:
    def chunk(kind: bytes, body: bytes) -> bytes:
        crc = zlib.crc32(kind + body)
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", crc)

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    body = zlib.compress(b"\0" * 100)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b"")


@pytest.mark.parametrize("size", [(10**5, 10**5), (20_000, 6_000), (2**31 - 1, 1)])
def test_huge_declared_sizes_are_refused_before_allocation(
    tmp_path: Path, size: tuple[int, int]
) -> None:
    (tmp_path / "a.png").write_bytes(_liar(*size))
    with pytest.raises((LimitExceeded, FormatError)):
        read_picture(tmp_path / "a.png")


def test_a_small_file_that_claims_many_pixels(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(_liar(9_000, 9_000))
    with pytest.raises(FormatError, match=r"has only .* bytes"):
        read_picture(tmp_path / "a.png")


def test_every_byte_of_a_png_changed_gives_pixels_or_a_named_error(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    data = bytearray(
        _png(tmp_path / "a.png", rng.integers(0, 9, (5, 6), dtype=np.uint8)).read_bytes()
    )
    refused = 0
    for place in range(len(data)):
        for bit in (1, 16, 128):
            mutant = bytearray(data)
            mutant[place] ^= bit
            (tmp_path / "m.png").write_bytes(mutant)
            try:
                got = read_picture(tmp_path / "m.png")
            except InputError:
                refused += 1
            else:
                assert got.ndim in (2, 3)
    assert refused > 1.5 * len(data)


def test_video_frames_in_order(tmp_path: Path) -> None:
    import cv2

    path = tmp_path / "a.avi"
    video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10, (64, 48))
    assert video.isOpened()
    for level in (10, 90, 200):
        video.write(np.full((48, 64, 3), (0, 0, level), np.uint8))
    video.release()
    frames = list(read_video(path))
    assert [f.shape for f in frames] == [(48, 64, 3)] * 3
    reds = [int(f[20, 20, 0]) for f in frames]
    assert all(abs(r - w) < 12 for r, w in zip(reds, (10, 90, 200), strict=True))


def test_a_video_that_was_cut_off_is_no_shorter_video(tmp_path: Path) -> None:
    import cv2

    path = tmp_path / "a.avi"
    video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10, (64, 48))
    for level in range(40):
        video.write(np.full((48, 64, 3), 5 * level, np.uint8))
    video.release()
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 6 // 10])
    with pytest.raises(FormatError, match=r"40 frames are declared, \d+ can be read"):
        list(read_video(path))


@pytest.mark.parametrize(("name", "codec"), [("a.mkv", "MJPG"), ("a.webm", "VP80")])
def test_matroska_tells_what_is_missing(tmp_path: Path, name: str, codec: str) -> None:
    import cv2

    path = tmp_path / name
    code = cv2.VideoWriter_fourcc(*codec)
    video = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, 10, (64, 48))
    for level in range(40):
        video.write(np.full((48, 64, 3), 5 * level, np.uint8))
    video.release()
    assert len(list(read_video(path))) == 40
    data = path.read_bytes()
    path.write_bytes(data[:-7])
    with pytest.raises(FormatError, match="7 bytes are missing at its end"):
        list(read_video(path))
    # A live stream does not know how long it will be: all bits of the size are set.
    begins = data.index(bytes.fromhex("18538067")) + 4
    path.write_bytes(data[:begins] + b"\x01" + 7 * b"\xff" + data[begins + 8 : -7])
    assert bytes_missing(path) == 0


def test_no_matroska_misses_nothing(tmp_path: Path) -> None:
    for data in (b"", b"\x00" * 40, b"RIFF of an AVI", bytes.fromhex("1a45dfa3"), b"\x1a" * 5000):
        (tmp_path / "a").write_bytes(data)
        assert bytes_missing(tmp_path / "a") == 0


def test_of_a_damaged_video_one_line_is_said(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    path.write_text("no video")
    code = f"from turnscan.scan import read_video; list(read_video({str(path)!r}))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert "moov" not in done.stderr
    assert "no video that OpenCV can open" in done.stderr


def test_a_video_that_is_none(tmp_path: Path) -> None:
    (tmp_path / "a.avi").write_text("no video")
    with pytest.raises(FormatError, match=r"a\.avi"):
        list(read_video(tmp_path / "a.avi"))
    with pytest.raises(InputError, match="no such video"):
        list(read_video(tmp_path / "b.avi"))


def test_steps_lie_apart_by_what_divides_all_numbers() -> None:
    assert numbers_apart([1, 3, 5], 1) == 2
    assert numbers_apart([0, 4, 6, 10], 0) == 2
    assert numbers_apart([7], 7) == 1
