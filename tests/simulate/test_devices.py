"""The simulated devices: pure functions of their address, with faults on request."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest

from turnscan.calibrate import detect_board, parse_board
from turnscan.devices import Camera, Lasers, Turntable
from turnscan.errors import DeviceRefused, DeviceTimeout, InputError
from turnscan.rig import Pose, rotation_from_vector, rotation_z
from turnscan.simulate import Simulated, SimulationSpec, bench, simulated, spec_of
from turnscan.simulate._motion import Motion
from turnscan.simulate._render import Renderer

CUP = "sim:cylinder?seed=3&steps=8"


def shot(devices: Simulated, angle: float, *lit: str) -> np.ndarray:
    devices.turntable.move_to(angle, 1.0)
    devices.lasers.light(frozenset(lit), 30.0)
    try:
        return devices.camera.grab(1.0)
    finally:
        devices.lasers.off()


def test_they_obey_the_protocols() -> None:
    d = simulated(CUP)
    assert isinstance(d.camera, Camera)
    assert isinstance(d.turntable, Turntable)
    assert isinstance(d.lasers, Lasers)


def test_a_picture_depends_on_step_light_and_seed_but_not_on_history() -> None:
    a, b = simulated(CUP), simulated(CUP)
    for d in (a, b):
        d.camera.configure(d.seconds, 1.0)
    first = shot(a, 0.0, "right")
    shot(a, 1.0)
    second = shot(a, 2.0, "right")
    assert (shot(b, 2.0, "right") == second).all()
    assert (shot(b, 0.0, "right") == first).all()
    assert (shot(a, 0.0, "right") != first).any()  # the next attempt has its own noise
    other = simulated("sim:cylinder?seed=4&steps=8")
    other.camera.configure(other.seconds, 1.0)
    assert (shot(other, 0.0, "right") != first).mean() > 0.2


def test_light_and_exposure_show_in_the_picture() -> None:
    d = simulated(CUP)
    d.camera.configure(d.seconds, 1.0)
    dark, lit = shot(d, 0.0), shot(d, 0.0, "right")
    assert int(lit.max()) > int(dark.max()) + 50
    d.camera.configure(d.seconds / 2, 1.0)
    half = shot(d, 0.0, "right").astype(float)
    assert half.sum() == pytest.approx(lit.astype(float).sum() / 2, rel=0.15)


def test_faults_on_request() -> None:
    dropping = simulated(CUP + "&drop=1")
    with pytest.raises(DeviceTimeout, match=r"no picture within 0\.5 s"):
        dropping.camera.grab(0.5)
    stale = simulated(CUP + "&stale=1")
    stale.camera.configure(stale.seconds, 1.0)
    first = shot(stale, 0.0, "right")
    assert shot(stale, 1.0) is first
    stuck = simulated(CUP + "&stuck_on=right")
    stuck.camera.configure(stuck.seconds, 1.0)
    assert shot(stuck, 0.0).max() > 60
    dead = simulated(CUP + "&stuck_off=right")
    dead.camera.configure(dead.seconds, 1.0)
    assert shot(dead, 0.0, "right").max() < 40


def test_a_lease_that_runs_out_darkens_the_laser() -> None:
    d = simulated(CUP)
    d.lasers.light(frozenset({"right"}), 1e5)
    assert d.world.burning
    d.lasers.renew(0.05)
    deadline = time.monotonic() + 120.0
    while d.world.burning and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not d.world.burning


def test_the_table_errs_as_asked() -> None:
    d = simulated("sim:cylinder?backlash_deg=0.5&eccentric_deg=0.2&missed=3")
    angle = d.world.bench.motion.angle
    back = angle(0.0, 0, False) - angle(0.0, 0, True)
    assert back == pytest.approx(math.radians(0.5), rel=0.02)
    assert angle(math.pi / 2) == pytest.approx(math.pi / 2 + math.radians(0.2), abs=1e-9)
    lost = angle(1.0, 2) - angle(1.0, 3)
    assert lost == pytest.approx(math.radians(1.8), rel=0.02)
    fine = simulated("sim:cylinder?microsteps=16&clockwise=1").world.bench.motion
    grid = math.radians(1.8) / 16
    assert fine.angle(0.123) == pytest.approx(-round(0.123 / grid) * grid)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda d: d.camera.configure(-0.01, 1.0), "exposure -0.01 s"),
        (lambda d: d.camera.configure(0.01, math.nan), "gain nan"),
        (lambda d: d.turntable.move_to(math.nan, 1.0), "angle nan"),
        (lambda d: d.lasers.light(frozenset({"blue"}), 1.0), "no 'blue'"),
        (lambda d: d.lasers.light(frozenset(), 0.0), "lease 0 s"),
    ],
)
def test_what_hardware_would_refuse(call: object, words: str) -> None:
    with pytest.raises(DeviceRefused, match=words):
        call(simulated(CUP))  # type: ignore[operator]


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("sim:teapot", "no scene 'teapot'"),
        ("sim:cup?rig=best", "no rig 'best'"),
        ("sim:cup?theta_deg=0", "theta 0°"),
        ("sim:cup?lasers=3", "3 lasers"),
        ("sim:cup?steps=0", "0 steps"),
        ("sim:cup?colour=red", "no key 'colour'"),
        ("sim:cup?seed=x", "seed='x'"),
        ("sim:cup?seed=1&seed=2", "is given twice"),
        ("sim:cup?x=nan", "x='nan'"),
        ("sim:missing.stl", "no such file"),
        ("sim:ball-bar?x=150", "larger than the field of view"),
        ("sim:cup?drop=2", "drop = 2"),
        ("sim:cup?backlash_deg=-1", "backlash"),
        ("uvc:0", "not a simulated device"),
    ],
)
def test_bad_addresses_give_one_clear_line(address: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as e:
        simulated(address)
    assert "\n" not in str(e.value)


def test_a_laser_that_never_hits_the_axis_is_named() -> None:
    from dataclasses import replace

    from turnscan.simulate import check_view

    good = simulated(CUP).world.bench
    beam = good.beams[0]
    sheet = good.rig.sheets[0]
    aside = replace(sheet, centre=sheet.centre + 40.0 * sheet.normal)
    lost = replace(
        good,
        rig=replace(good.rig, sheets=(aside,)),
        beams=(replace(beam, apex=beam.apex + 40.0 * sheet.normal),),
    )
    check_view(good)
    with pytest.raises(InputError, match="'right' never hits the rotation axis"):
        check_view(lost)


def test_every_key_of_an_address_arrives() -> None:
    spec, faults = spec_of(
        "sim:head?rig=modern&theta_deg=25&lasers=1&seed=9&steps=12&speckle=0&room=0.1&x=2&y=-3"
        "&lean_x_deg=5&tip_deg=90&galvo=105&lying=1&stale=0.25&pattern=bars"
    )
    assert spec == SimulationSpec(
        "head", "modern", math.radians(25), 1, 9, 12, "diffraction", False, 0.1, (2.0, -3.0),
        (math.radians(5), 0.0), math.radians(90), galvo=105.0, lying=True,
        pattern="bars",
    )  # fmt: skip
    assert faults.stale == 0.25


def test_a_camera_that_lies_on_its_side_sees_the_same_turned_by_a_quarter() -> None:
    upright, lying = (
        Renderer(simulated(f"sim:bracket?speckle=no&lying={how}").world.bench)
        for how in ("no", "yes")
    )
    one, other = (r.electrons(0.3, {"right"}, 0.04) for r in (upright, lying))
    assert one.shape == (480, 640)
    # A pixel's rays are spread more finely across its rows than along them: the light is the same
    # within what that leaves.
    assert np.abs(np.rot90(one) - other).sum() < 0.01 * one.sum()
    camera = lying.bench.rig.camera
    assert (camera.width, camera.height) == (480, 640)


def test_a_part_tipped_over_lies_on_the_platter_with_its_middle_over_the_axis() -> None:
    body = bench(SimulationSpec("cup", tip=math.radians(90), shift=(3.0, -2.0))).scene.bodies[0]
    seen = body.T_table_part.apply(body.part.mesh.vertices)
    low, high = seen.min(axis=0), seen.max(axis=0)
    assert np.allclose((low + high)[:2] / 2, [3.0, -2.0])
    assert low[2] == pytest.approx(0.0)
    assert high[1] - low[1] == pytest.approx(84.0, abs=0.5), "it lies: its height runs along y"


def test_a_hand_holds_the_board_another_way_each_time_and_puts_it_on_the_table() -> None:
    board = parse_board("charuco:9x6:12:9:DICT_5X5_100")

    def poses(devices: Simulated, times: int) -> list[np.ndarray]:
        seen = []
        for _ in range(times):
            devices.camera.configure(devices.seconds, 1.0)
            view = detect_board(devices.camera.grab(1.0), board)
            assert len(view.corners) >= 6
            seen.append(view.corners)
        return seen

    d = simulated("sim:cylinder?seed=3&hand=charuco")
    plain = simulated("sim:cylinder?seed=3")
    assert d.world.bench.rig.T_camera_table.translation == pytest.approx(
        plain.world.bench.rig.T_camera_table.translation
    )
    first = poses(d, 2)
    again = poses(simulated("sim:cylinder?seed=3&hand=charuco"), 1)
    assert (first[0] == again[0]).all()
    assert np.abs(first[0].mean(axis=0) - first[1].mean(axis=0)).max() > 10.0
    d.turntable.move_to(0.0, 1.0)
    standing = detect_board(d.camera.grab(1.0), board)
    d.turntable.move_to(0.3, 1.0)
    turned = detect_board(d.camera.grab(1.0), board)
    truth = d.world.bench
    for view, angle in ((standing, 0.0), (turned, 0.3)):
        own = board.points[view.ids]
        # Its first corner is one square in from the print's own, which has 10 mm of margin above.
        body = np.stack([np.zeros(len(own)), own[:, 0] - 42.0, 70.0 - own[:, 1]], axis=1)
        T = truth.rig.T_camera_table @ truth.motion.pose(angle) @ truth.scene.bodies[0].T_table_part
        away = truth.rig.camera.project(T.apply(body)) - view.corners
        assert np.abs(away).max() < 0.5
    with pytest.raises(InputError, match="no board 'cup'"):
        simulated("sim:cylinder?hand=cup")


def test_the_back_of_a_board_is_blank() -> None:
    d = simulated("sim:charuco?room=0.3")
    d.camera.configure(d.seconds, 1.0)
    front, back = shot(d, 0.0), shot(d, math.pi)
    middle = (slice(200, 280), slice(280, 360))
    assert front[middle].std() > 4 * back[middle].std()


def test_a_table_that_leans_and_runs_in_a_circle_carries_the_part_as_one() -> None:
    """What goes round with the table is one place of the part on it, at all angles; what the axis
    itself does is not."""
    easy = Motion(wobble=0.01, runout=0.4)
    first = easy.pose(0.0)
    for a in np.arange(0.5, 6.0, 0.5):
        back = Pose(rotation_z(-a), np.zeros(3)) @ easy.pose(a)
        assert back.rotation == pytest.approx(first.rotation, abs=1e-12)
        assert back.translation == pytest.approx(first.translation, abs=1e-12)
    assert first.translation == pytest.approx([0.4, 0.0, 0.0])
    hard = Motion(axis_tilt=0.01, axis_shift=0.4, axial=0.3)
    for a in (0.0, 1.0, 4.0):
        pose = hard.pose(a)
        tilt = rotation_from_vector(0.01 * np.array([np.cos(a), -np.sin(a), 0.0]))
        assert pose.rotation == pytest.approx(tilt @ rotation_z(a), abs=1e-12)
        shift = [0.4 * np.cos(a), -0.4 * np.sin(a), 0.3 * np.cos(a)]
        assert pose.translation == pytest.approx(shift, abs=1e-12)


def test_the_axis_errors_of_an_address_are_in_its_pictures() -> None:
    motion = spec_of("sim:cylinder?axis_tilt_deg=0.1&axis_shift=-0.2&axial=0.3")[0].motion
    assert motion.axis_tilt == pytest.approx(math.radians(0.1))
    assert (motion.axis_shift, motion.axial) == (-0.2, 0.3)
    with pytest.raises(InputError, match="axial"):
        spec_of("sim:cylinder?axial=inf")
    with pytest.raises(ValueError, match=r"Motion\.axis_shift"):
        Motion(axis_shift=math.nan)
    tops = []
    for address in (CUP, CUP + "&axial=3"):
        d = simulated(address)
        d.camera.configure(d.seconds, 1.0)
        for angle in (0.0, math.pi):
            lit, dark = (shot(d, angle, *names).astype(float) for names in (("right",), ()))
            rows = (lit - dark).max(axis=1) if lit.ndim == 2 else (lit - dark).max(axis=(1, 2))
            tops.append(int(np.flatnonzero(rows > 40)[0]))
    T, camera = d.world.bench.rig.T_camera_table, d.world.bench.rig.camera
    px = 3.0 * camera.fy / float(np.linalg.norm(T.translation))
    assert tops[0] - tops[2] == pytest.approx(px, rel=0.3)
    assert tops[3] - tops[1] == pytest.approx(px, rel=0.3)
