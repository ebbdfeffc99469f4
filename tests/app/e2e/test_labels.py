"""Every room, tab, form and dialog: no label is cut, and screen readers have what they need."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator

from axe_playwright_python.sync_playwright import Axe

from tests.app.e2e.conftest import OPENING, until
from tests.app.e2e.pages import connect, disconnect, mark, rows, settled

SIZES = ((640, 400), (1024, 700))
"""640 px are 1 280 px at 200 % zoom."""
ROOMS = {
    "projects": "Scans", "rig": "Setup", "scan": "Scan", "measure": "Inspect", "export": "Export",
    "calibrate": "Calibrate",
}  # fmt: skip
"""What is in the address, and the name of the room's main region."""
FORMS = (
    "import", "calibrate", "range-scans", "join", "export", "section", "compare", "measure",
    "shapes", "revolve", "check", "verify",
)  # fmt: skip
TABS = ("Point", "Holes", "History", "Settings", "Repair")
WITH_FIELDS = ("Brush", "Region bounded by sharp edges", "Smoothing brush", "Cut by a plane")
"""Tools that show fields of their own."""
OPEN_ALL = "for (const one of document.querySelectorAll('main details')) one.open = true"
CUT = """
() => [...document.querySelectorAll(
    "button, label, h1, h2, h3, summary, legend, dt, dd, th, .chip, .key span, .about," +
    " .with-unit span")]
  .filter((e) => e.checkVisibility() && !e.closest(".sr-only") && e.textContent.trim())
  .filter((e) => {
    const box = e.getBoundingClientRect();
    if (box.right > innerWidth + 1 || box.left < -1) return true;
    if (e.clientWidth > 0 && e.scrollWidth > e.clientWidth + 1) return true;
    for (let up = e.parentElement; up; up = up.parentElement) {
      if (getComputedStyle(up).overflowX === "visible") continue;
      const left = up.getBoundingClientRect().left + up.clientLeft;
      // What lies under a scroll bar is not seen either.
      if (box.right > left + up.clientWidth + 1 || box.left < left - 1) return true;
    }
    return false;
  })
  .map((e) => `${e.localName} “${e.textContent.trim().slice(0, 40)}”`)
"""
CUT_IN_FIELDS = """
() => [...document.querySelectorAll("input[type=number], input[type=text], input[type=search]")]
  .filter((e) => e.checkVisibility() && !e.closest(".sr-only") && !e.readOnly)
  .filter((e) => {
    const style = getComputedStyle(e);
    const pen = document.createElement("canvas").getContext("2d");
    pen.font = `${style.fontWeight} ${style.fontSize} ${style.fontFamily}`;
    const wide = pen.measureText(e.value || e.placeholder).width;
    const [left, right] = [parseFloat(style.paddingLeft), parseFloat(style.paddingRight)];
    const unit = e.parentElement.querySelector(":scope > span")?.getBoundingClientRect();
    const end = e.getBoundingClientRect().right - right;
    return wide > e.clientWidth - left - right + 1 || (unit && unit.left < end - 1);
  })
  .map((e) => `field “${e.value || e.placeholder}” of ${e.labels[0]?.textContent}`)
"""


def cut(page) -> list[str]:
    """Labels, texts and fields of which a part is not seen."""
    return [*page.evaluate(CUT), *page.evaluate(CUT_IN_FIELDS)]


AXE = """
(rules) => axe.run(document, { resultTypes: ["violations"], ...rules }).then((r) => r.violations)
"""
CONTRAST = {"runOnly": {"type": "rule", "values": ["color-contrast"]}}
"""What the theme can change."""
TURN = "document.documentElement.dataset.theme = "


def serious(page, **rules) -> list[str]:
    """What is wrong for people who see little or nothing; ``rules`` are options of axe-core."""
    if not page.evaluate("'axe' in window"):
        page.evaluate(Axe().axe_script)
    return [
        f"{v['id']}: {v['nodes'][0]['html'][:160]}"
        for v in page.evaluate(AXE, rules)
        if v["impact"] in ("serious", "critical")
    ]


def looked_at(page, name: str) -> list[str]:
    """What is wrong with the page as it is, in both sizes and both themes."""
    wrong = []
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        settled(page)
        if page.evaluate("document.documentElement.scrollWidth") > width:
            wrong.append(f"{name} is wider than {width} px")
        wrong += [f"{name} at {width} px: {label}" for label in cut(page)]
    for theme, rules in (("light", CONTRAST), ("dark", {})):
        page.evaluate(f"{TURN}'{theme}'")
        settled(page)
        wrong += [f"{name}, {theme}: {one}" for one in serious(page, **rules)]
    return wrong


def shown(page, what: str) -> None:
    """Open everything that can be unfolded, once the room is there."""
    page.locator(f"main[aria-label='{what}']").wait_for(state="attached")
    page.evaluate(OPEN_ALL)
    settled(page)


def repairing(page) -> Iterator[str]:
    """The panels of the Edit room, with an edit, one that is undone, and a point."""
    page.get_by_role("button", name="Show expert panels").click()
    page.keyboard.press("Control+a")
    page.keyboard.press("Delete")
    until(page, "turnscan.edits === 1")
    page.keyboard.press("Control+z")
    until(page, "turnscan.cursor === 0")
    mark(page, 57, 128)
    for tab in TABS:
        page.get_by_role("tab", name=tab, exact=True).click()
        shown(page, "Edit")
        yield f"Edit, {tab}"
    tools = page.get_by_role("toolbar", name="Tools")
    for name in WITH_FIELDS:
        tools.get_by_role("button", name=name, exact=True).click()
        shown(page, "Edit")
        yield f"Edit, {name}"
    tools.get_by_role("button", name="Look and click points").click()


def dialogs(page) -> Iterator[str]:
    """The dialogs that any room opens, and that of the Edit room."""
    for keys in ("?", "Control+k"):
        page.keyboard.press(keys)
        page.get_by_role("dialog").wait_for()
        yield keys
        page.keyboard.press("Escape")
    page.get_by_role("tab", name="History").click()
    yield from opened_by(page, "Copy edits to another scan")


def opened_by(page, button: str) -> Iterator[str]:
    """The dialog that a button opens."""
    page.get_by_role("button", name=button).click()
    page.get_by_role("dialog").wait_for()
    yield button
    page.keyboard.press("Escape")


def elsewhere(page, scan: str) -> Iterator[str]:
    """The other rooms, the formats of files, the steps of the wizard, and the forms."""
    for room, name in ROOMS.items():
        page.evaluate(f"location.hash = '{room}/{scan}'")
        shown(page, name)
        inside = {
            "export": page.get_by_role("radiogroup", name="Format").get_by_role("radio"),
            "calibrate": page.get_by_role("navigation", name="Steps").get_by_role("button"),
        }.get(room, page.get_by_role("none"))
        if room == "measure":
            page.get_by_role("button", name="Across z").click()
            page.get_by_role("button", name="Area", exact=True).click()
            page.get_by_role("button", name="Measure it").click()
            rows(page).first.wait_for()
            rows(page).first.get_by_role("button", name="±").click()
            rows(page).first.get_by_role("button", name="±").hover()
            yield f"{name}, its budget"
            yield from opened_by(page, "Measure the same on another scan")
        for k in range(max(1, inside.count() - (room == "calibrate"))):
            if room in ("export", "calibrate"):
                inside.nth(k).click()
                shown(page, name)
            yield f"{name} {k + 1}"
        if room == "projects":
            yield from opened_by(page, "Invite another browser")
    for verb in FORMS:
        page.evaluate(f"location.hash = 'do-{verb}/{scan}'")
        shown(page, "Files")
        yield f"form {verb}"


def test_nowhere_a_label_is_cut_or_anything_is_wrong_for_screen_readers(
    open_cup: Callable, folder, cup, picture
):
    shutil.copy(cup, folder / "another.turnscan")
    page = open_cup(width=1024)
    scan = page.evaluate("location.hash.split('/')[1]")
    wrong = []
    for places in (repairing(page), dialogs(page), elsewhere(page, scan)):
        for name in places:
            wrong += looked_at(page, name)
            picture(page, f"labels-{name}".replace(" ", "-"))
    assert wrong == []


def test_nothing_is_cut_while_settings_are_tried(open_cup):
    page = open_cup(width=1024)
    page.get_by_role("tab", name="Settings").click()
    page.locator("details[data-title='Compare two settings'] summary").click()
    every = page.get_by_role("spinbutton", name="Every", exact=True)
    every.fill("2")
    every.press("Enter")
    page.get_by_role("region", name="Patch, as typed").wait_for(timeout=1000 * OPENING)
    wrong = serious(page)
    for width, height in (*SIZES[1:], (1280, 800)):
        page.set_viewport_size({"width": width, "height": height})
        settled(page)
        wrong += [f"at {width} px: {label}" for label in cut(page)]
    assert wrong == []


def connected(page) -> Iterator[str]:
    """The rooms of the scanner while it is connected, and while one looks through its camera."""
    connect(page, "sim:cup?rig=ciclop")
    shown(page, "Setup")
    yield "Setup, connected"
    page.get_by_role("button", name="Start live view").click()
    page.get_by_role("button", name="Stop live view").wait_for()
    shown(page, "Setup")
    yield "Setup, live"
    page.get_by_role("button", name="Stop live view").click()
    page.get_by_role("button", name="Scan", exact=True).click()
    shown(page, "Scan")
    yield "Scan, connected"
    page.get_by_role("button", name="Setup", exact=True).click()
    disconnect(page)


def test_nothing_is_cut_or_wrong_while_a_scanner_is_connected(new_page, picture):
    page = new_page(width=1024)
    wrong = []
    for name in connected(page):
        wrong += looked_at(page, name)
        page.set_viewport_size({"width": 1024, "height": 700})
        picture(page, f"labels-{name}".replace(" ", "-"))
    assert wrong == []
