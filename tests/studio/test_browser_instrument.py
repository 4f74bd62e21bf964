"""Charts that are stopped, widened and saved; every size of page; what axe-core finds."""

import csv
import io
from collections.abc import Callable

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from tests.studio.browser import SOON_MS, enabled, state, undisturbed
from tests.studio.conftest import Studio

SIZES = [(390, 844), (844, 390), (768, 1024), (1024, 700), (1280, 800), (1920, 1080), (3840, 2160)]
MOST_KNOB_PX = 200
NEXT_PICTURE = "() => new Promise((done) => requestAnimationFrame(() => setTimeout(done)))"


def chart(page: Page) -> str:
    """The chart itself: a page that stood still for a moment says so in front of it."""
    return str(page.evaluate("document.querySelector('#chart-command canvas').toDataURL()"))


def drawn(page: Page) -> str:
    """The chart after what was pressed has been drawn."""
    for _ in range(2):
        page.evaluate(NEXT_PICTURE)
    return chart(page)


def test_a_chart_is_stopped_and_goes_on(shared: Studio, tab: Callable[..., Page]) -> None:
    page = tab(shared)
    page.wait_for_timeout(1000)
    page.click("#pause")
    expect(page.locator("#pause")).to_have_attribute("aria-pressed", "true")
    before = drawn(page)
    page.wait_for_timeout(1500)
    assert chart(page) == before
    page.click("#longer")
    assert drawn(page) != before
    page.click("#shorter")
    assert drawn(page) == before
    page.click("#pause")
    expect(page.locator("#pause")).to_have_attribute("aria-pressed", "false")
    assert drawn(page) != before


def test_the_cursor_shows_values(shared: Studio, tab: Callable[..., Page]) -> None:
    page = tab(shared)
    page.wait_for_timeout(1500)
    box = page.locator("#chart-sway").bounding_box()
    assert box
    page.mouse.move(box["x"] + box["width"] - 30, box["y"] + box["height"] / 2)
    for legend in ("#legend-sway", "#legend-command"):  # one time in both
        expect(page.locator(f"{legend} b").nth(1)).to_have_text(" 0.0")


HISTORY = """async () => {
    const { History } = await import("/static/history.js");
    const history = new History(["speed"], ["axis"], 10, 6);
    const look = { state: "ready", level: "ready", reason: "at rest" };
    for (let t = 0; t < 25; t += 1) {
        history.push(t, { speed: t % 2 ? t : null }, { axis: t < 20 ? look : null });
    }
    const rows = Array.from({ length: history.length }, (_, row) => row);
    const long = { t: rows.map((row) => history.time(row)),
        speed: rows.map((row) => history.value(row, "speed")),
        state: rows.map((row) => history.look(row, "axis")?.state ?? null),
        from: [0, 20.5, 21, 99].map((t) => history.from(t)),
        after: [0, 20.5, 21, 99].map((t) => history.after(t)) };
    for (let i = 0; i < 35; i += 1) history.push(100 + i / 10, {}, { axis: look });
    return { long, many: [history.length, history.first, history.last, history.looks.length] };
}"""


def test_the_charts_drop_what_is_too_old_or_too_much(
    shared: Studio, tab: Callable[..., Page]
) -> None:
    """Ten rows, 6 s: of rows a second apart 6 s are kept, of rows 0.1 s apart ten."""
    kept = tab(shared).evaluate(HISTORY)
    assert kept["long"] == {
        "t": [18, 19, 20, 21, 22, 23, 24],
        "speed": [None, 19, None, 21, None, 23, None],
        "state": ["ready", "ready", None, None, None, None, None],
        "from": [0, 3, 3, 7],
        "after": [0, 3, 4, 7],
    }
    assert kept["many"] == [10, 102.5, 103.4, 2]


def test_what_was_driven_is_saved_as_a_table_and_as_a_picture(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own())

    def drive() -> None:
        page.keyboard.down("a")
        expect(state(page, 1)).to_have_text("moving, shaped", timeout=SOON_MS)
        page.keyboard.up("a")

    undisturbed(page, drive)
    page.wait_for_timeout(500)
    with page.expect_download() as download:
        page.click("#csv")
    assert download.value.suggested_filename == "canshaper.csv"
    rows = list(csv.DictReader(io.StringIO(download.value.path().read_text())))
    times = [float(row["seconds"]) for row in rows]
    assert times == sorted(times) and times[0] == 0.0 and times[-1] > 1.0
    assert max(float(row["slew command joystick"] or 0) for row in rows) > 50.0
    assert max(abs(float(row["slew sway raw"] or 0)) for row in rows) > 1.0
    assert "lift command shaped" in rows[0]
    with page.expect_download() as download:
        page.click("#png")
    assert download.value.path().read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_nothing_is_cut_off_at_any_size(
    shared: Studio, tab: Callable[..., Page], width: int, height: int
) -> None:
    page = tab(shared, viewport={"width": width, "height": height})
    expect(page.locator("#fps")).not_to_have_text("0")
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    for name in ("#controls button:visible", "#pads svg", "#sliders input", "#scene", ".chart"):
        for one in page.locator(name).all():
            box = one.bounding_box()
            assert box and box["x"] >= 0 and box["x"] + box["width"] <= width, name
            assert box["height"] > 10, name


def test_a_finger_finds_its_targets(shared: Studio, tab: Callable[..., Page]) -> None:
    """44 px each, the joysticks at both edges, and text that is not selected."""
    page = tab(shared, viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    for button in page.locator("button:visible").all():
        box = button.bounding_box()
        assert box and box["width"] >= 44 and box["height"] >= 44, button.inner_text()
    left, right = (page.locator(f"#pad{n}").bounding_box() for n in (0, 1))
    assert left and right
    assert left["x"] < 40 and right["x"] + right["width"] > 350
    assert left["width"] <= MOST_KNOB_PX
    assert page.evaluate("getComputedStyle(document.querySelector('#hands')).userSelect") == "none"


def test_at_200_percent_zoom_in_forced_colors_everything_is_there(
    shared: Studio, tab: Callable[..., Page]
) -> None:
    """1280 x 800 at 200 % is 640 x 400; all of it can be scrolled to, and lanes keep colours."""
    page = tab(shared, viewport={"width": 640, "height": 400}, forced_colors="active")
    expect(page.locator("#fps")).not_to_have_text("0")
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    for name in ("#controls button", "#pads svg", "#sliders input", ".chart", "#events"):
        for one in page.locator(name).all():
            if one.is_visible():
                one.scroll_into_view_if_needed()
                box = one.bounding_box()
                assert box and box["x"] >= 0 and box["x"] + box["width"] <= 640, name
    violations = Axe().run(page).response["violations"]
    assert [(one["id"], [n["target"] for n in one["nodes"]]) for one in violations] == []


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_axe_finds_nothing(
    own: Callable[..., Studio], tab: Callable[..., Page], scheme: str, width: int
) -> None:
    page = tab(own(), color_scheme=scheme, viewport={"width": width, "height": 800})
    for driving in (False, True):
        if driving:
            enabled(page)
        expect(page.locator("#fps")).not_to_have_text("0")
        violations = Axe().run(page).response["violations"]
        assert [(one["id"], [n["target"] for n in one["nodes"]]) for one in violations] == []


def test_states_and_events_stand_on_the_time_axis(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    """A lane for each crane; the cursor shows the state then, and the event of a mark."""
    page = tab(own())

    def drive() -> None:
        page.wait_for_timeout(1000)  # each state is some pixels wide
        page.keyboard.down("a")
        expect(state(page, 1)).to_have_text("moving, shaped", timeout=SOON_MS)
        page.wait_for_timeout(1000)
        page.keyboard.press(" ")
        expect(state(page, 1)).to_have_text("tripped: neutral", timeout=SOON_MS)
        page.keyboard.up("a")

    undisturbed(page, drive)
    page.wait_for_timeout(500)
    page.click("#pause")
    box = page.locator("#chart-states .u-over").bounding_box()
    assert box
    states, marks = set(), set()
    for x in range(int(box["width"])):
        page.mouse.move(box["x"] + x, box["y"] + box["height"] / 2)
        page.evaluate(NEXT_PICTURE)
        if page.is_visible("#legend-states"):
            states.add(page.inner_text("#legend-states b >> nth=0").strip())
        else:
            marks.add(page.inner_text("#mark"))
            assert page.evaluate("mark.scrollWidth <= mark.clientWidth"), "nothing is cut off"
    assert {"waiting for neutral", "ready", "moving, shaped", "tripped: neutral"} <= states
    # Both cranes stop within a pixel: no mark hides another.
    for crane in ("shaped", "raw"):
        assert any(f"{crane}: slew: tripped: neutral" in mark for mark in marks), crane
    assert any(mark.startswith(("shaped: slew: tripped", "raw: slew: tripped")) for mark in marks)
    # All of them stand in the table, too.
    with page.expect_download() as download:
        page.click("#csv")
    rows = list(csv.DictReader(io.StringIO(download.value.path().read_text())))
    assert {"moving, shaped", "tripped: neutral"} <= {row["slew state shaped"] for row in rows}
    assert {"moving, unshaped", "tripped: neutral"} <= {row["slew state raw"] for row in rows}
