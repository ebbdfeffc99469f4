"""``turnscan scan``, ``resume``, ``doctor`` and ``devices``, as typed."""

from __future__ import annotations

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from fractions import Fraction
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from tests.needs import needs
from turnscan.cli import turnscan
from turnscan.cli._signals import was_interrupted
from turnscan.cli._words import error_line
from turnscan.errors import InputError, ScanBusy, TurnscanError
from turnscan.scan import Scan
from turnscan.scanner import stops_of

pytestmark = pytest.mark.slow

BENCH = "sim:sphere?speckle=0"


def cli(*words: str | Path) -> Result:
    return CliRunner().invoke(turnscan, [str(w) for w in words])


def pixels(path: Path) -> list[tuple[object, ...]]:
    """All but the time of day."""
    with Scan.open(path) as scan:
        return [
            (s.row.laser, s.row.step, s.row.commanded, s.row.noise, s.row.level, s.payload)
            for s in scan.stored()
        ]


def start(*words: str | Path) -> subprocess.Popen[str]:
    code = "from turnscan.cli import main; main()"
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, words)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def when_frames_are_in(path: Path, count: int, child: subprocess.Popen[str]) -> None:
    end = time.monotonic() + 90
    while time.monotonic() < end:
        assert child.poll() is None, child.communicate()
        try:
            with Scan.open(path) as scan:
                if len(scan) >= count:
                    return
        except TurnscanError:
            pass
        time.sleep(0.01)
    raise AssertionError("no frames came")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "a.turnscan"
    done = cli("scan", path, "--device", BENCH, "--steps", "14")
    assert done.exit_code == 0, done.output
    assert "threshold" in done.output
    assert "a.turnscan: SIMULATED, of no real part: 14 frames taken; whole" in done.output
    assert "SIMULATED" in done.output
    return path


def test_a_scan_is_whole_and_reconstructed(whole: Path, tmp_path: Path) -> None:
    assert cli("check", whole).exit_code == 0
    again = cli("resume", whole)
    assert "already complete" in again.output
    made = cli("reconstruct", whole, "-o", tmp_path / "a.ply")
    assert (tmp_path / "a.ply").exists(), made.output


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM", "SIGKILL"])
def test_interrupted_and_resumed_to_the_byte(whole: Path, tmp_path: Path, number: str) -> None:
    needs("POSIX")
    path = tmp_path / "a part.turnscan"
    child = start("scan", path, "--device", BENCH, "--steps", "14")
    try:
        when_frames_are_in(path, 2, child)
        # Somebody looks on meanwhile.
        looked = cli("check", "--json", path)
        with pytest.raises(ScanBusy):
            Scan.resume(path)
        child.send_signal(getattr(signal, number))
        _, said = child.communicate(timeout=60)
    finally:
        child.kill()
        child.communicate()
    codes = {f["code"] for f in json.loads(looked.output)["findings"]}
    assert codes == {"scan.in-progress", "scan.missing-step"}
    if number == "SIGKILL":
        assert child.returncode == -signal.SIGKILL
    else:
        assert child.returncode == 130, said
        assert f"of 14 steps are stored → turnscan resume {shlex.quote(str(path))}\n" in said
    with Scan.open(path) as scan:
        assert 2 <= len(scan) < 14
    made = cli("reconstruct", path, "-o", tmp_path / "a.ply")
    assert (tmp_path / "a.ply").exists(), made.output
    done = cli("resume", path)
    assert done.exit_code == 0, done.output
    assert pixels(path) == pixels(whole)
    assert sorted(os.listdir(tmp_path)) == ["a part.turnscan", "a.ply"]


def test_damaged_frames_are_taken_again_on_request(whole: Path, tmp_path: Path) -> None:
    import sqlite3

    path = tmp_path / "a.turnscan"
    path.write_bytes(whole.read_bytes())
    db = sqlite3.connect(path)
    payload = bytearray(db.execute("SELECT payload FROM frames WHERE step = 7").fetchone()[0])
    payload[len(payload) // 2] ^= 4
    db.execute("UPDATE frames SET payload = ? WHERE step = 7", (bytes(payload),))
    db.commit()
    db.close()
    assert cli("check", path).exit_code == 1
    assert "already complete" in cli("resume", path).output
    assert "1 damaged or missing frames" in cli("resume", path, "--retake").output
    assert cli("check", path).exit_code == 0
    assert pixels(path) == pixels(whole)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["a.turnscan", "--steps", "0"], "--steps 0"),
        (["a.turnscan", "--steps", "10000000"], "10000000 steps"),
        (["a.turnscan", "--step-deg", "0"], "--step-deg 0"),
        (["a.turnscan", "--steps", "4", "--step-deg", "3"], "give one of them"),
        (["a.turnscan", "--laser-names", "green"], "no laser 'green'"),
        (["a.turnscan", "--exposure", "-1"], "exposure -1"),
        (["a.turnscan", "--device", "sim:nothing"], "no scene"),
        (["a.turnscan", "--device", "sim:cup", "--camera", "uvc:0"], "stands for"),
        (["a.turnscan", "--camera", "uvc:0"], "--turntable: not given"),
        (["a.turnscan", "--camera", "uvc:0", "--turntable", "grbl:/dev/no-such-port"], "no-such"),
        (["a.turnscan", "--camera", "sim:cup", "--turntable", "sim:mug"], "in one"),
        (["a.txt"], "ends .turnscan"),
        (["no/a.turnscan"], "no folder"),
        (["there.turnscan"], "already exists"),
    ],
)  # fmt: skip
def test_what_cannot_be_done_is_one_line_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.turnscan").write_text("precious")
    done = cli("scan", *words)
    assert isinstance(done.exception, TurnscanError), done.output
    assert says in error_line(done.exception)
    assert "\n" not in str(done.exception)
    assert os.listdir(tmp_path) == ["there.turnscan"]
    assert (tmp_path / "there.turnscan").read_text() == "precious"


def test_the_exposure_is_found_on_the_stripe(tmp_path: Path) -> None:
    bench = "sim:cup?speckle=no&room=0.02"
    path = tmp_path / "auto.turnscan"
    said = cli("scan", path, "--device", bench, "--steps", "1", "--auto-exposure")
    assert said.exit_code == 0, said.output
    found = re.search(r"exposure ([\d.]+) ms: the stripe reaches (\d+)% of the scale", said.output)
    assert found
    assert 60 <= int(found[2]) <= 80
    with Scan.open(path) as scan:
        frame = scan.frame(0, "right")
    assert float(frame.settings["seconds"]) == pytest.approx(float(found[1]) / 1000, rel=0.01)
    assert 100 < frame.lit.max() < 255


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--device", "sim:cup?speckle=no", "--exposure", "0.1"],
         "fixed and automatic exposure are mutually exclusive"),
        (["--device", "sim:cup?speckle=no&stuck_off=right"], "no stripe is found"),
    ],
)  # fmt: skip
def test_an_exposure_that_cannot_be_found(more: list[str], said: str, tmp_path: Path) -> None:
    path = tmp_path / "auto.turnscan"
    words = ["--steps", "1", "--auto-exposure", *more]
    result = cli("scan", path, *words)
    assert isinstance(result.exception, InputError)
    assert said in str(result.exception)
    assert not path.exists()


def test_an_import_cannot_be_resumed(tmp_path: Path) -> None:
    from tests.scan.small import write

    write(tmp_path / "a.turnscan", steps=3)
    done = cli("resume", tmp_path / "a.turnscan")
    assert isinstance(done.exception, InputError)
    assert "not made by turnscan scan" in str(done.exception)


def test_stops() -> None:
    whole_turn = (Fraction(0), Fraction(360))
    assert stops_of(whole_turn, 400, None, 9) == (Fraction(9, 10), 400)
    assert stops_of(whole_turn, None, Fraction(7), 9) == (Fraction(7), 52)
    assert stops_of(whole_turn, None, None, 200) == (Fraction(9, 5), 200)
    part = (Fraction(-30), Fraction(60))
    assert stops_of(part, 4, None, 9) == (Fraction(30), 4)
    assert stops_of(part, None, Fraction(45), 9) == (Fraction(45), 3)
    assert stops_of(part, None, None, 400) == (Fraction(90, 100), 101)
    assert stops_of((Fraction(60), Fraction(-30)), None, Fraction(45), 9) == (Fraction(-45), 3)
    assert stops_of((Fraction(0), Fraction(-720)), 10, None, 9) == (Fraction(-72), 10)
    assert stops_of((Fraction(5), Fraction(5)), None, None, 9) == (Fraction(0), 1)
    with pytest.raises(InputError, match="2 steps or more"):
        stops_of(part, 1, None, 9)


def test_doctor_measures_and_finds() -> None:
    done = cli("doctor", "--device", "sim:hexagon?x=6&lasers=2&speckle=0&room=0.3", "--json")
    assert done.exit_code == 0, done.output
    facts = json.loads(done.output)
    assert facts["table"]["degrees_per_turn"] == 360.0
    assert facts["table"]["counter_clockwise"] is True
    assert facts["camera"]["seconds"] == 0.04
    assert 0.2 < facts["camera"]["noise"] < 2.0
    left, right = sorted(facts["lasers"], key=lambda x: x["name"])
    assert left["column"] < right["column"]
    assert 0.5 < left["width"] < 4.0
    assert (facts["verdict"], facts["next_step"]) == ("ready", "scan the part")


@pytest.mark.parametrize(
    ("fault", "code"),
    [("clockwise=1", "doctor.direction"), ("stuck_off=left", "doctor.no-stripe")],
)
def test_doctor_names_what_is_wrong(fault: str, code: str) -> None:
    bench = f"sim:hexagon?x=6&lasers=2&speckle=0&room=0.3&{fault}"
    done = cli("doctor", "--device", bench, "--json")
    assert done.exit_code == 1
    facts = json.loads(done.output)
    (worst,) = [f for f in facts["findings"] if f["severity"] != "note"]
    assert worst["code"] == code
    assert facts["verdict"] == "not ready"
    assert facts["next_step"] == f"{worst['where']}: {worst['remedy']}"


def test_devices_lists_without_opening_anything() -> None:
    done = cli("devices", "--json")
    assert done.exit_code == 0
    assert "uvc" in json.loads(done.output)["camera_schemes"]
    lost = cli("devices", "/dev/no-such-port")
    assert lost.exit_code == 1
    assert "no controller" in lost.output


def test_devices_finds_the_board_behind_a_port() -> None:
    from tests.devices.boards import firmware
    from turnscan.simulate.controllers import Socket

    for dialect in ("grbl", "horus"):
        board = firmware(dialect)
        with Socket(board) as socket:
            done = cli("devices", socket.path)
            assert f"{dialect}:{socket.path}" in done.output
        assert not [entry for entry in board.log if entry.outputs], "nothing was lit"
        assert board.turns == 0


def test_a_signal_that_compiled_code_wraps_is_still_an_interruption() -> None:
    wrapped = SystemError("compiled code returned a result with an exception set")
    assert not was_interrupted(wrapped)
    wrapped.__cause__ = KeyboardInterrupt()
    assert was_interrupted(wrapped)
    assert was_interrupted(KeyboardInterrupt())
    assert not was_interrupted(ZeroDivisionError())


def test_devices_tells_which_laser_is_which() -> None:
    bench = "sim:hexagon?lasers=2&speckle=0"
    done = cli("devices", "--device", bench)
    assert done.exit_code == 0, done.output
    assert re.search(r"laser right: stripe at \d+ px: right\nlaser left: .*: left\n", done.output)
    assert "lasers=right,left" in done.output
    dead = cli("devices", "--device", f"{bench}&stuck_off=right", "--json")
    assert dead.exit_code == 1
    assert [x["place"] for x in json.loads(dead.output)["lasers"]] == ["dark", "the only one"]


def test_devices_finds_the_rate_at_which_a_board_talks() -> None:
    from tests.devices.boards import firmware
    from turnscan.devices import probe_port
    from turnscan.simulate.controllers import Socket

    with Socket(firmware("horus"), baud=19200) as socket:
        wrong = probe_port(socket.path, (("horus", 115200),))
        assert wrong.address == ""
        found = probe_port(socket.path, (("horus", 115200), ("horus", 19200)))
        assert found.address == f"horus:{socket.path}?baud=19200"
    assert not [entry for entry in socket.firmware.log if entry.outputs]
    assert socket.firmware.turns == 0
