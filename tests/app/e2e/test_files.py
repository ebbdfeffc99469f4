"""Files dropped on the page are named, and become scans and comparisons: by visible labels."""

from __future__ import annotations

import io
import re
import shutil
from pathlib import Path

import numpy as np
from PIL import Image as Pillow
from playwright.sync_api import expect

from tests.app.e2e.conftest import OPENING, until
from tests.app.e2e.pages import run_command
from tests.poses.scenes import STEPS, rig_for, stripes
from tests.web.uploads import box, zipped
from turnscan.formats import export
from turnscan.rig import rig_to_json

LONG = OPENING * 1000
"""ms for a verb: on a new machine the kernels are compiled first."""


def _turn() -> dict[str, bytes]:
    """Pictures of a turn of a part, as files of a folder."""
    u, rng, out = np.arange(320), np.random.default_rng(1), {}
    for k, stripe in enumerate(stripes("knob")):
        at = np.nan_to_num(stripe.position, nan=-1e3)[:, None]
        light = 180 * np.exp(-0.5 * ((u - at) / 1.5) ** 2) + rng.normal(12, 1.0, (240, 320))
        file = io.BytesIO()
        Pillow.fromarray(light.clip(0, 255).astype(np.uint8)).save(file, "png")
        out[f"turn/s{k}.png"] = file.getvalue()
    return out


def test_a_zip_of_pictures_is_named_imported_and_opened(new_page, picture, folder: Path) -> None:
    (folder / "rig.json").write_text(rig_to_json(rig_for("knob")))
    page = new_page()
    turn = {"name": "turn.zip", "mimeType": "application/zip", "buffer": zipped(_turn())}
    page.get_by_label("Files", exact=True).set_input_files(turn)
    dropped = page.get_by_role("region", name="What was dropped")
    expect(dropped).to_contain_text(f"{STEPS} pictures", timeout=LONG)
    dropped.get_by_role("button", name="Import pictures").click()
    form = page.get_by_role("form", name="Import pictures")
    begin = form.get_by_role("button", name="Import pictures")
    # What is in the pictures is shown before anything is imported, with the stripe of any of them.
    expect(form.get_by_text(f"{STEPS}, steps 0 to {STEPS - 1}")).to_be_visible(timeout=LONG)
    slider = form.get_by_role("slider", name="Picture")
    slider.fill("3")
    expect(form.get_by_role("heading", name="s3.png")).to_be_visible(timeout=LONG)
    expect(form.get_by_text("step 3 · stripe in")).to_be_visible()
    page.set_viewport_size({"width": 1280, "height": 1200})
    picture(page, "import")
    begin.click()
    said = form.get_by_role("alert").first
    expect(said).to_have_text("This is needed.")
    angles = form.get_by_label("Angles")
    angles.fill("6 degrees")
    angles.press("Tab")
    begin.click()
    expect(said).to_contain_text("neither a step", timeout=LONG)
    form.get_by_role("button", name="Markers on the table").click()
    expect(angles).to_have_value("markers")
    form.get_by_label("CSV file").set_input_files(
        {"name": "stops.csv", "mimeType": "text/csv", "buffer": b"0\n15\n30\n"}
    )
    expect(angles).to_have_value("stops.csv")
    form.get_by_role("button", name="Even steps of a full turn").click()
    expect(angles).to_have_value(f"step:{360 / STEPS:g}")
    form.get_by_role("combobox", name="Rig").select_option(label="rig.json (a rig)")
    form.get_by_label("Laser", exact=True).fill("L0")
    form.get_by_label("Laser", exact=True).press("Tab")
    begin.click()
    form.get_by_role("button", name="Open turn.turnscan").click(timeout=LONG)
    until(page, "turnscan.faces > 1000", OPENING)
    expect(page).to_have_url(re.compile("#repair/"))


def test_a_folder_of_pictures_is_sent_with_its_folders(new_page, tmp_path: Path) -> None:
    some = dict(list(_turn().items())[::5])
    for name, data in some.items():
        for laser in ("left", "right"):
            path = tmp_path / "two lasers" / laser / Path(name).name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
    (tmp_path / "two lasers" / ".hidden").write_text("of a file manager")
    page = new_page()
    run_command(page, "import pictures", "Import pictures")
    form = page.get_by_role("form", name="Import pictures")
    form.get_by_label("Pictures from a folder").set_input_files(tmp_path / "two lasers")
    for laser in ("left", "right"):
        row = form.get_by_role("group", name="Pictures", exact=True).get_by_label(
            f"two lasers/{laser} ({len(some)} pictures)"
        )
        expect(row).to_be_checked(timeout=LONG)
    expect(form.get_by_role("combobox", name="Laser")).to_have_value("left", timeout=LONG)


def test_two_meshes_are_compared_and_the_picture_downloaded(
    new_page, picture, folder: Path, tmp_path: Path
) -> None:
    for name, size in (("measured.stl", 10.0), ("nominal.stl", 10.1)):
        (folder / name).write_bytes(export(box(size), ".stl"))
    page = new_page()
    run_command(page, "compare", "Compare with a reference")
    form = page.get_by_role("form", name="Compare with a reference")
    form.get_by_role("combobox", name="Measured").select_option(label="measured.stl (a mesh)")
    begin = form.get_by_role("button", name="Compare with a reference")
    begin.click()
    expect(form.get_by_role("alert").first).to_have_text("Choose or drop a file.")
    form.get_by_role("combobox", name="Reference", exact=True).select_option(
        label="nominal.stl (a mesh)"
    )
    begin.click()
    expect(form.get_by_text("against the reference")).to_contain_text("0.1000 mm", timeout=LONG)
    page.set_viewport_size({"width": 1280, "height": 1400})
    picture(page, "compare")
    with page.expect_download() as waiting:
        form.get_by_role("link", name="measured compare-picture.png").click()
    shutil.copy(waiting.value.path(), tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
