"""Views in place of the cranes: from above, and the swing that the filter leaves."""

import re
from collections.abc import Callable

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from tests.studio.browser import enabled, undisturbed
from tests.studio.conftest import Opened, Studio

PAST = re.compile(r"(\w+): grapple up to (\d+) cm")


def past_cm(page: Page) -> dict[str, int]:
    """How far each grapple gets from its tip, as the plan says."""
    words = page.get_attribute("#plan", "aria-label") or ""
    return {name: int(cm) for name, cm in PAST.findall(words)}


def test_from_above_the_raw_grapple_gets_farther(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own())
    page.keyboard.press("b")
    expect(page.locator("#plan")).to_be_visible()
    expect(page.locator("#scene")).to_be_hidden()

    def drive() -> None:
        page.keyboard.down("a")
        page.wait_for_timeout(900)
        page.keyboard.up("a")
        expect(page.locator("#axes .state[data-level=ready]")).to_have_count(6)
        page.wait_for_timeout(3000)
        cm = past_cm(page)
        assert cm["raw"] > 20
        assert cm["shaped"] < cm["raw"] / 3

    undisturbed(page, drive)
    page.keyboard.press("b")
    expect(page.locator("#plan")).to_be_hidden()
    expect(page.locator("#scene")).to_be_visible()


def test_the_overshoot_of_a_drive_is_that_of_its_sway(tab: Callable[..., Page]) -> None:
    """At the end the tip stands; the grapple hangs 1.2 m below its second joint, and a little."""
    studio = Opened("forwarder.yaml", "--seed", "3")
    try:
        page = tab(studio)
        page.click("#above")
        page.select_option("#speed", "5")
        page.click("#play")
        expect(page.locator("#play")).to_have_text("Play")
        expect(page.locator("#plan")).to_have_attribute("aria-label", PAST)
        cm = past_cm(page)
        assert cm["forwarder"] < cm["raw"]
        expect(page.locator("#left")).to_be_hidden()
    finally:
        studio.stop()


def test_what_the_filter_leaves_follows_its_slider(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own())
    enabled(page)
    page.click("#left")
    words = page.locator("#residual-words")
    expect(words).to_contain_text("The filter believes 1.38 m (line); the file says 1.38 m")
    expect(page.locator("#residual canvas")).to_be_visible()
    page.locator("#slider-length").focus()
    page.keyboard.press("End")
    expect(words).to_contain_text("The filter believes 2.75 m (line); the file says 1.38 m")
    page.click("#tabs [data-axis=lift]")
    expect(words).to_contain_text("no one curve")
    expect(page.locator("#residual canvas")).to_have_count(0)
    page.click("#left")
    expect(page.locator("#scene")).to_be_visible()


@pytest.mark.parametrize("view", ["#above", "#left"])
def test_axe_finds_nothing(shared: Studio, tab: Callable[..., Page], view: str) -> None:
    page = tab(shared)
    page.click(view)
    page.wait_for_timeout(1000)
    violations = Axe().run(page).response["violations"]
    assert [(one["id"], [n["target"] for n in one["nodes"]]) for one in violations] == []


# Cranes in a pose, drawn for a while: where the grapples are then, in halves of the picture.
GRAPPLES_SEEN = """async ([hello, shown]) => {
    const { Scene } = await import("/static/scene.js");
    const canvas = document.createElement("canvas");
    canvas.style.cssText = "position: fixed; inset: 0 auto auto 0; width: 600px; height: 340px";
    document.body.append(canvas);
    const scene = new Scene(canvas, hello);
    scene.add(shown);
    for (let i = 0; i < 200; i += 1) {
        await new Promise(requestAnimationFrame);
        scene.draw(performance.now());
    }
    const at = Object.values(scene.cranes).map((crane) => {
        const seen = crane.grapple.getWorldPosition(scene.camera.position.clone());
        seen.project(scene.camera);
        return Math.max(Math.abs(seen.x), Math.abs(seen.y));
    });
    scene.dispose();
    canvas.remove();
    return at;
}"""


@pytest.mark.parametrize("slewed_deg", [-90.0, 160.0])
def test_no_grapple_leaves_the_picture(
    shared: Studio, tab: Callable[..., Page], slewed_deg: float
) -> None:
    page = tab(shared)
    with shared.page() as other:
        shown = other.until(lambda s: all(crane["pose"] for crane in s["cranes"].values()))
    for crane in shown["cranes"].values():
        crane["pose"] = [slewed_deg, 8.0, crane["pose"][2]]
    halves = page.evaluate(GRAPPLES_SEEN, [other.hello, shown])
    assert len(halves) == 2
    assert max(halves) < 1.0


# The same from the side: how far the tip is from the load in the picture's own metres.
HANGS_M = """async ([hello, shown]) => {
    const { SideView } = await import("/static/side_view.js");
    const canvas = document.createElement("canvas");
    canvas.style.cssText = "position: fixed; inset: 0 auto auto 0; width: 600px; height: 340px";
    document.body.append(canvas);
    const view = new SideView(canvas, hello);
    view.add(shown);
    view.draw();
    canvas.remove();
    return Object.values(shown.cranes).map((crane) => {
        const { tip, grapple } = view.points(crane);
        return [tip[0] <= view.reach, tip[1] <= view.height, tip[1] - grapple[1]];
    });
}"""


@pytest.mark.parametrize(
    ("file", "hangs_m"),
    [
        ("tower-crane", 30.0),
        ("telehandler", 8.0),
        ("bridge-crane", 8.0),
        ("bridge-crane-hook", 10.0),
        ("multicopter", 5.0),
    ],
)
def test_a_crane_with_a_rope_is_drawn_in_both_views(
    own: Callable[..., Studio], tab: Callable[..., Page], file: str, hangs_m: float
) -> None:
    studio = own(file=f"config/{file}.yaml", groups=())
    page = tab(studio)
    expect(page.locator("#nopose")).to_be_hidden()
    with studio.page() as other:
        shown = other.until(lambda s: all(crane["measured"] for crane in s["cranes"].values()))
    assert max(page.evaluate(GRAPPLES_SEEN, [other.hello, shown])) < 1.0
    for inside, below, hangs in page.evaluate(HANGS_M, [other.hello, shown]):
        assert inside and below
        assert hangs == pytest.approx(hangs_m, abs=0.02)


def test_a_multicopter_that_is_far_away_is_in_the_picture(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    studio = own(file="config/multicopter.yaml", groups=())
    page = tab(studio)
    with studio.page() as other:
        shown = other.until(lambda s: all(crane["measured"] for crane in s["cranes"].values()))
    for crane in shown["cranes"].values():
        crane["trolley"] = [400.0, -60.0, 5.0]
    assert max(page.evaluate(GRAPPLES_SEEN, [other.hello, shown])) < 1.0
    (_, _, hangs), *_ = page.evaluate(HANGS_M, [other.hello, shown])
    assert hangs == pytest.approx(5.0, abs=0.02)


# What a crane is made of below each group, and where the parts of its base and its turntable are.
PARTS = """async (hello) => {
    const { Crane } = await import("/static/crane.js");
    const crane = new Crane(hello, "one", "--raw");
    return [crane.base, crane.slew].map((group) => group.children.map((one) => one.position.z));
}"""


def test_an_excavator_has_tracks_and_a_house(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    studio = own(file="config/excavator.yaml", groups=())
    page = tab(studio)
    with studio.page() as other:
        base, slew = page.evaluate(PARTS, other.hello)
        forwarder, _ = page.evaluate(PARTS, {**other.hello, "drawn": None})
    assert base == pytest.approx([0.45, 0.45, 0.85])
    assert slew[:3] == pytest.approx([1.5, 1.6, 1.9])
    assert len(forwarder) == 8


def test_the_hint_covers_no_words_of_a_view(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own())
    expect(page.locator("#hint")).to_be_visible()
    page.click("#left")
    expect(page.locator("#residual-words")).to_be_visible()
    expect(page.locator("#hint")).to_be_hidden()


def test_in_forced_colors_what_is_pressed_is_filled(
    shared: Studio, tab: Callable[..., Page]
) -> None:
    page = tab(shared, forced_colors="active")
    background = "one => getComputedStyle(one).backgroundColor"
    page.click("#above")
    pressed, other = (page.locator(one).evaluate(background) for one in ("#above", "#left"))
    assert pressed != other


def test_on_a_large_screen_charts_and_words_are_larger(
    shared: Studio, tab: Callable[..., Page]
) -> None:
    page = tab(shared, viewport={"width": 3840, "height": 2160})
    for name, least_px in (("#chart-command", 300), ("#axes td", 40)):
        box = page.locator(name).first.bounding_box()
        assert box and box["height"] > least_px


def test_the_load_of_a_bridge_crane_is_drawn_and_seen_from_above(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own(file="bridge-crane.yaml"))
    expect(page.locator("#scene")).to_be_visible()
    expect(page.locator("#sway-of")).to_have_text("degrees, along the runway")
    page.keyboard.press("b")

    def drive() -> None:
        page.keyboard.down("d")
        page.wait_for_timeout(900)
        page.keyboard.up("d")
        page.wait_for_timeout(2500)
        assert past_cm(page)["raw"] > 30

    undisturbed(page, drive)
