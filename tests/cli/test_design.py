"""``turnscan design`` as a person meets it."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.needs import needs
from turnscan import cli
from turnscan.points import triangulate
from turnscan.rig import rig_from_json

PRINTED = {
    "delta_x_mm": ((2.5, 1.64, 0.76, 0.44, 0.25), 0.005),
    "delta_r_mm": ((2.53, 1.7, 0.88, 0.62, 0.51), 0.005),
    "r_max_mm": ((312, 265, 189, 155, 140), 0.5),
    "h_max_mm": ((67, 84, 116, 135, 149), 0.5),
}


class _Door:
    """The command line run in this process: exit code, output, error output."""

    def __init__(self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
        self._capsys, self._monkeypatch = capsys, monkeypatch

    def __call__(self, *args: str) -> tuple[int, str, str]:
        self._monkeypatch.setattr(sys, "argv", ["turnscan", "design", *args])
        code = 0
        try:
            cli.main()
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else 1
        said = self._capsys.readouterr()
        return code, said.out, said.err


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> _Door:
    return _Door(capsys, monkeypatch)


def _json(run: _Door, *args: str) -> Any:
    code, out, err = run(*args, "--json")
    assert code == 0, err

    def refuse(name: str) -> None:
        raise AssertionError(f"{name} in JSON")

    return json.loads(out, parse_constant=refuse)


def test_table_1_as_the_paper_prints_it(run: _Door) -> None:
    code, out, err = run("--paper")
    assert code == 0, err
    rows = [line.split() for line in out.splitlines()]
    for row in (
        "θ 10° 15° 30° 45° 60°",
        "Δx [mm] 2.5 1.64 0.76 0.44 0.25",
        "ΔR [mm] 2.53 1.7 0.88 0.62 0.51",
        "R_max [mm] 312 265 189 155 140",
        "H_max [mm] 67 84 116 135 149",
        "ΔR/R_max 0.008 0.0064 0.0047 0.004 0.0036",
    ):
        assert row.split() in rows
    for figure in ("15.7°", "19.6°", "200×480", "9.8 mm", "0.14 mm", "4.4 mm", "0.31 mm"):
        assert figure in out
    for place in ("Δx row", "ΔR row", "H_max row", "ΔR/R_max row", "1/123", "1/275", "1/831"):
        assert sum(place in line for line in out.splitlines()) == 1


def test_table_1_as_json_is_unrounded(run: _Door) -> None:
    body = _json(run, "--paper")
    rows = body["rows"]
    assert [r["theta_deg"] for r in rows] == [10, 15, 30, 45, 60]
    for key, (values, half) in PRINTED.items():
        for row, printed in zip(rows, values, strict=True):
            assert abs(row[key] - printed) <= half
    for row in rows:
        ratio = row["delta_r_mm"] / row["r_max_mm"]
        assert row["delta_r_over_r_max"] == pytest.approx(ratio, rel=1e-14)
        tan, L, eps, f = math.tan(math.radians(row["theta_deg"])), 500.0, 0.011, 12.5
        assert row["delta_x_mm"] == pytest.approx(eps * L / (f * tan), rel=1e-13)
    assert len(body["disagreements"]) == 7
    assert body["gamma_max_deg"] == pytest.approx(15.7272, abs=1e-4)
    assert body["beta_max_deg"] == pytest.approx(19.6078, abs=1e-4)
    assert (body["grid_profiles"], body["grid_points"]) == (200, 480)
    assert body["densest_grid"]["10"]["circumferential_mm"] == pytest.approx(9.809, abs=1e-3)
    assert body["densest_grid"]["60"]["vertical_mm"] == pytest.approx(0.3097, abs=1e-4)


def test_options_change_what_they_name(run: _Door) -> None:
    body = _json(
        run,
        *("--preset", "paper", "--theta-deg", "10:60:25", "--theta-deg", "22.4,22.5"),
        *("--distance", "490", "--focal", "16", "--pixel-um", "5.5,4.5", "--sensor", "1280x960"),
        *("--pan-deg", "2", "--laser-offset", "0.5", "--f-number", "5.6", "--step-deg", "0.9"),
        *("--wavelength-nm", "520", "--stripe-sigma-px", "1.8", "--electrons", "9000"),
        *("--read-noise", "4", "--speckle-contrast", "0.7"),
    )
    assert [r["theta_deg"] for r in body["rows"]] == [10, 35, 60, 22.4, 22.5]
    design = body["designs"][0]
    expected = {
        "distance": 490,
        "focal": 16,
        "pixel_width": 5.5e-3,
        "pixel_height": 4.5e-3,
        "columns": 1280,
        "rows": 960,
        "pan": math.radians(2),
        "offset": 0.5,
        "f_number": 5.6,
        "step": math.radians(0.9),
        "wavelength": 520e-6,
        "stripe_sigma": 1.8,
        "electrons": 9000,
        "read_noise": 4,
        "speckle_contrast": 0.7,
    }
    for name, value in expected.items():
        assert design[name] == pytest.approx(value, rel=1e-12), name


def test_what_has_no_number_is_null_or_a_dash(run: _Door) -> None:
    args = ("--preset", "paper", "--theta-deg", "10")
    assert _json(run, *args)["rows"][0]["r_min_mm"] is None
    line = next(x for x in run(*args)[1].splitlines() if "other edge" in x)
    assert line.endswith("—")


def test_many_angles_come_in_blocks(run: _Door) -> None:
    code, out, _ = run("--theta-deg", "10:60:5")
    assert code == 0
    heads = [line for line in out.splitlines() if line.startswith("θ")]
    assert [len(h.split()) - 1 for h in heads] == [7, 4]
    assert max(len(line) for line in out.splitlines()) < 130


@pytest.mark.parametrize(
    ("args", "says"),
    [
        (("--theta-deg", "0"), "theta is 0°"),
        (("--theta-deg", "90"), "theta is 90°"),
        (("--theta-deg", "nan"), "--theta-deg"),
        (("--theta-deg", "thirty"), "'thirty'"),
        (("--theta-deg", "10:60"), "'10:60'"),
        (("--theta-deg", "60:10:5"), "60:10:5"),
        (("--theta-deg", "10:60:0"), "10:60:0"),
        (("--theta-deg", "1:80:0.001"), "1 to 100 angles"),
        (("--theta-deg", ""), "--theta-deg"),
        (("--focal", "-16"), "focal is -16"),
        (("--focal", "nan"), "nan"),
        (("--distance", "inf"), "inf"),
        (("--distance", "1e300"), "distance is 1e+300"),
        (("--sensor", "0x0"), "columns is 0"),
        (("--sensor", "640"), "'640'"),
        (("--sensor", "-5x7"), "'-5x7'"),
        (("--pixel-um", "0"), "pixel_width is 0"),
        (("--pixel-um", "1,2,3"), "'1,2,3'"),
        (("--pan-deg", "-80"), "outside the field of view"),
        (("--step-deg", "0"), "step is 0°"),
        (("--paper", "--focal", "16"), "--paper"),
    ],
)
def test_bad_input_is_one_line(run: _Door, args: tuple[str, ...], says: str) -> None:
    code, out, err = run(*args)
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert says in err


def test_picture(run: _Door, tmp_path: Path) -> None:
    from PIL import Image

    picture_path = tmp_path / "rig.png"
    code, out, err = run(
        "--preset", "paper", "--theta-deg", "10,30", "--picture", str(picture_path)
    )
    assert code == 0, err
    assert "θ = 10°" in out
    assert picture_path.stat().st_size < 250_000
    with Image.open(picture_path) as picture:
        assert picture.width > 800
        colours = picture.convert("RGB").getcolors(2**24)
    assert colours is not None
    assert len(colours) > 100
    assert [p.name for p in tmp_path.iterdir()] == ["rig.png"]


@pytest.mark.parametrize("extra", [("--pan-deg", "7.9", "--focal", "25.5"), ("--pan-deg", "12")])
def test_picture_of_a_panned_camera(run: _Door, extra: tuple[str, ...], tmp_path: Path) -> None:
    picture_path = tmp_path / "rig.png"
    code, _, err = run("--preset", "paper", *extra, "--picture", str(picture_path))
    assert code == 0, err
    assert err == ""


def test_a_picture_that_cannot_be_written(run: _Door, tmp_path: Path) -> None:
    nowhere = tmp_path / "missing" / "rig.png"
    code, _, err = run("--picture", str(nowhere))
    assert code == 5
    assert err.count("\n") == 1
    assert str(nowhere) in err
    code, _, err = run("--picture", str(tmp_path))
    assert code == 2
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_the_table_loads_nothing_heavy() -> None:
    probe = (
        "import sys\nfrom turnscan.cli import turnscan\n"
        "try: turnscan.main(['design', '--paper'])\nexcept SystemExit: pass\n"
        "print([m for m in ('scipy', 'matplotlib', 'numba', 'cv2') if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", probe], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.rstrip().endswith("[]")


def test_the_table_is_quick() -> None:
    """In multiples of starting Python with numpy, by processor time: others may be busy."""
    needs("POSIX")
    import resource

    def seconds(*args: str) -> float:
        used = []
        for _ in range(4):
            subprocess.run([sys.executable, *args], capture_output=True, timeout=120, check=True)
            usage = resource.getrusage(resource.RUSAGE_CHILDREN)
            used.append(usage.ru_utime + usage.ru_stime)
        return used[-1] - used[0]  # without the first, which may compile

    assert seconds("-m", "turnscan", "design", "--paper") < 8 * seconds("-c", "import numpy")


def test_an_entered_rig_measures_as_the_closed_form(
    run: _Door, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    geometry = ("--theta-deg", "22.5", "--distance", "500", "--focal", "12.5")
    code, _, err = run(*geometry, "--pixel-um", "11,9", "--sensor", "640x480", "--rig", "rig.json")
    assert code == 0, err
    rig = rig_from_json(Path("rig.json").read_text())
    pixels = np.array([[u, v] for u in (330.0, 400.0, 500.0, 630.0) for v in (3.0, 200.0, 470.0)])
    seen, _ = triangulate(rig, "right", pixels, np.ones(len(pixels)))
    got = rig.T_camera_table.inverse().apply(seen)
    x = (pixels[:, 0] - 319.5) * 0.011
    y = (239.5 - pixels[:, 1]) * 0.009
    theta = math.radians(22.5)
    # Plane through the axis, pinhole at L: R = L x / (f sin θ + x cos θ).
    radius = 500 * x / (12.5 * math.sin(theta) + x * math.cos(theta))
    assert np.hypot(got[:, 0], got[:, 1]) == pytest.approx(radius, rel=1e-9)
    height = y / 12.5 * (500 - radius * math.cos(theta))
    assert got[:, 2] - got[:, 2].mean() == pytest.approx(height - height.mean(), abs=1e-9)


def test_a_rig_has_one_angle(run: _Door, tmp_path: Path) -> None:
    code, _, err = run("--theta-deg", "10,20", "--rig", str(tmp_path / "rig.json"))
    assert code == 2
    assert "one angle" in err
    assert not list(tmp_path.iterdir())
