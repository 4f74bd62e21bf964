"""The first screen shows what a person needs at once, and it is true after a stop too."""

from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.studio.browser import SOON_MS, state, undisturbed
from tests.studio.conftest import Studio

SIZES = [(390, 844), (820, 1180), (1440, 900)]
SCHEMES = ["dark", "light"]
STAND_STILL = "(ms) => { const end = performance.now() + ms; while (performance.now() < end); }"
LAYOUT_SHIFTS = """() => { window.shifts = 0; new PerformanceObserver((list) => {
    for (const one of list.getEntries()) window.shifts += one.value;
}).observe({ type: "layout-shift", buffered: false }); }"""


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_first_screen_has_cranes_state_reason_and_stop(
    shared: Studio, tab: Callable[..., Page], width: int, height: int, scheme: str
) -> None:
    page = tab(shared, viewport={"width": width, "height": height}, color_scheme=scheme)
    expect(page.locator("#why-shaped")).to_have_text("waiting for neutral: enable is off")
    for name in ("#stop", "#why-shaped", "#why-raw", "#swing-shaped", "#swing-raw", "#scene"):
        box = page.locator(name).bounding_box()
        assert box and box["y"] >= 0 and box["y"] + box["height"] <= height, name
        assert box["x"] >= 0 and box["x"] + box["width"] <= width, name
    assert page.locator("#swings").evaluate("(one) => one.scrollWidth <= one.clientWidth")
    page.evaluate("scrollTo(0, 900)")
    stop = page.locator("#stop").bounding_box()
    assert stop and stop["width"] >= 80 and stop["y"] >= 0


@pytest.mark.parametrize("width", [390, 1440])
def test_stop_stops_and_its_events_stay_in_sight(
    own: Callable[..., Studio], tab: Callable[..., Page], width: int
) -> None:
    page = tab(own(), viewport={"width": width, "height": 900})
    page.evaluate(LAYOUT_SHIFTS)

    def drive() -> None:
        page.keyboard.down("a")
        expect(state(page, 1)).to_have_text("moving, shaped", timeout=SOON_MS)
        page.click("#stop")
        expect(page.locator("#why-shaped")).to_contain_text("tripped: neutral", timeout=SOON_MS)
        page.keyboard.up("a")
        tripped = page.locator("#events li", has_text="slew: tripped")
        expect(tripped.first).to_be_attached(timeout=SOON_MS)
        page.wait_for_timeout(300)
        away = "(list) => list.scrollHeight - list.scrollTop - list.clientHeight"
        assert page.locator("#events").evaluate(away) < 30
        page.keyboard.press("e")
        expect(state(page, 1)).to_have_text("ready", timeout=SOON_MS)

    undisturbed(page, drive)
    assert page.evaluate("shifts") < 0.1


def test_the_list_of_events_stays_where_a_person_scrolled_to(
    shared: Studio, tab: Callable[..., Page]
) -> None:
    page = tab(shared)
    events = page.locator("#events")
    for _ in range(4):
        page.keyboard.press("n")
        page.wait_for_timeout(200)
    events.evaluate(
        "(list) => { list.style.flex = 'none'; list.style.height = '60px'; list.scrollTop = 0;"
        " list.dispatchEvent(new Event('scroll')); }"  # before anyone learns of the new size
    )
    page.wait_for_timeout(200)
    assert events.evaluate("(list) => list.scrollTop") > 0  # it followed while it shrank
    events.evaluate("(list) => { list.scrollTop = 0; }")
    page.wait_for_timeout(200)
    page.keyboard.press("n")
    page.keyboard.press("n")
    page.wait_for_timeout(500)
    assert events.evaluate("(list) => list.scrollTop") == 0


def test_a_crane_without_anti_sway_is_not_called_shaped(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own())
    name, still = page.locator(".swing b").first, page.locator("#still-shaped")
    expect(name).to_have_text("shaped")
    page.keyboard.press("e")
    expect(page.locator("#seat")).to_have_text("you drive")
    expect(state(page, 1, "slew")).to_have_text("ready", timeout=SOON_MS)
    page.keyboard.press("a", delay=500)
    expect(still).to_contain_text("still after", timeout=SOON_MS)
    page.keyboard.press("n")
    expect(name).to_have_text("anti-sway off", timeout=SOON_MS)
    expect(still).to_have_text("", timeout=SOON_MS)  # it was of the other setting
    page.keyboard.press("n")
    expect(name).to_have_text("shaped", timeout=SOON_MS)


def test_the_colours_of_states_are_explained(shared: Studio, tab: Callable[..., Page]) -> None:
    page = tab(shared)
    expect(page.locator("#levels span")).to_have_text(
        ["ready", "waits", "moves", "stops", "tripped"]
    )
    colours = page.locator("#levels i").evaluate_all(
        "(all) => all.map((one) => getComputedStyle(one).backgroundColor"
        " + getComputedStyle(one).backgroundImage)"
    )
    assert len(set(colours)) == 5


def test_a_picture_that_is_drawn_coarser_says_so(shared: Studio, tab: Callable[..., Page]) -> None:
    """The browser of the tests has no graphics card."""
    page = tab(shared)
    expect(page.locator("#coarse")).to_contain_text("drawn coarser: no graphics card")
    assert page.locator("#scene").evaluate("(one) => one.width < one.clientWidth")


def test_a_page_that_stood_still_at_rest_says_so_in_a_line(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own())
    page.wait_for_timeout(1500)  # by then there are pictures
    page.evaluate(STAND_STILL, 900)
    expect(page.locator("#events li", has_text="The page stood still").first).to_be_attached()
    expect(page.locator("#hiccup")).to_be_hidden()
