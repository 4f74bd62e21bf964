"""The page never shows what is not so: lost networks, stalls, missing measurements, no WebGL."""

import io
import os
import re
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from PIL import Image
from playwright.sync_api import Browser, Page, expect

from tests.studio.browser import SOON_MS, enabled, opened, state, undisturbed
from tests.studio.conftest import Studio, command_of
from tests.studio.proxy import Proxy

STAND_STILL = "ms => { const t = performance.now(); while (performance.now() - t < ms); }"
LOSE_WEBGL = (
    "() => document.getElementById('scene').getContext('webgl2')"
    ".getExtension('WEBGL_lose_context').loseContext()"
)
NO_WEBGL = """
const of = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind.startsWith("webgl") ? null : of.call(this, kind, ...more);
};
"""


@contextmanager
def stopped(pid: int) -> Iterator[None]:
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


def is_stale(page: Page) -> None:
    expect(page.locator("body")).to_have_class("stale", timeout=SOON_MS)
    expect(page.locator("#link")).to_have_text("no connection")
    expect(page.locator("#banner")).to_contain_text("all that is shown is old")
    assert page.evaluate("getComputedStyle(document.querySelector('main')).filter") != "none"


def is_fresh(page: Page) -> None:
    expect(page.locator("#link")).to_have_text("connected")
    expect(page.locator("#banner")).to_be_hidden()
    expect(page.locator("body")).not_to_have_class("stale")


def test_a_network_that_swallows_every_byte_is_reported(
    own: Callable[..., Studio], chromium: Browser
) -> None:
    """No side closes anything, as when a cable is pulled."""
    with Proxy(own().port) as proxy:
        faults: list[str] = []
        page = opened(chromium, proxy.url, faults)
        enabled(page)
        proxy.lose()
        is_stale(page)
        # By then the page has given up that connection: what was swallowed of it is missing.
        expect(page.locator("#banner")).to_contain_text(re.compile(r"for [2-9]\.\d s"))
        proxy.restore()
        is_fresh(page)
        enabled(page)  # it takes its own joysticks back
        page.context.close()
    assert faults == []


def test_a_network_that_is_slow_to_connect_is_no_lost_one(
    own: Callable[..., Studio], chromium: Browser
) -> None:
    """Longer than a page waits for messages, and then the first one comes a little later."""
    with Proxy(own().port) as proxy:
        proxy.slow_down(connect_s=2.1, begin_s=0.3)
        page = opened(chromium, proxy.url, [])
        is_fresh(page)
        page.context.close()


def test_a_studio_that_stands_still_is_reported(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    studio = own()
    page = tab(studio)
    with stopped(studio.process.pid):
        is_stale(page)
    is_fresh(page)


def test_a_long_picture_does_not_stop_the_joysticks(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    """The studio lets go after 200 ms of silence; the page draws for 230 ms."""
    page = tab(own())

    def drive() -> None:
        before = page.locator("#events li", has_text="is silent").count()
        page.keyboard.down("a")
        expect(state(page, 1)).to_have_text("moving, shaped", timeout=SOON_MS)
        for _ in range(3):
            page.evaluate(STAND_STILL, 230)
            page.wait_for_timeout(100)
        page.wait_for_timeout(500)  # by then an event would be shown
        assert page.locator("#events li", has_text="is silent").count() == before
        expect(state(page, 1)).to_have_text("moving, shaped")
        page.keyboard.up("a")

    undisturbed(page, drive)


def test_a_page_that_stood_still_says_so_and_its_joysticks_went_to_neutral(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own())
    enabled(page)
    page.keyboard.down("a")
    expect(state(page, 1)).to_have_text("moving, shaped", timeout=SOON_MS)
    page.wait_for_timeout(1000)  # a hiccup before is not taken for this one
    page.evaluate(STAND_STILL, 900)
    expect(page.locator("#hiccup b")).to_contain_text("The page stood still for")
    expect(page.locator("#hiccup span")).to_contain_text("went to neutral")
    # The key is still down; only after neutral does it count again.
    expect(state(page, 1)).to_have_text("ready", timeout=SOON_MS)
    page.keyboard.up("a")
    expect(page.locator("#hiccup")).to_be_hidden()


def test_numbers_names_and_cranes_stand_in_one_order(
    shared: Studio, tab: Callable[..., Page]
) -> None:
    page = tab(shared, viewport={"width": 1280, "height": 800}, color_scheme="light")
    names = page.locator(".swing b:first-child").all_inner_texts()
    assert names == page.locator("#axes th").all_inner_texts()[1:] == ["shaped", "raw"]
    lines = page.locator("#legend-command span").all_inner_texts()
    assert lines == ["joystick", "shaped", "raw"]
    expect(page.locator("#fps")).not_to_have_text("0")
    page.wait_for_timeout(1000)
    picture = Image.open(io.BytesIO(page.locator("#scene").screenshot())).convert("RGB")
    places: dict[str, list[int]] = {"shaped": [], "raw": []}
    for x in range(0, picture.width, 2):
        for y in range(0, picture.height, 2):
            red, green, blue = picture.getpixel((x, y))  # type: ignore[misc]
            if green > red + 40 and green > 60:
                places["shaped"].append(x)
            elif red > green + 60 and red > blue + 60:
                places["raw"].append(x)
    middle = {name: sum(xs) / len(xs) for name, xs in places.items()}
    assert middle["shaped"] < middle["raw"]


def test_without_webgl_there_is_a_view_from_the_side_and_it_is_said(
    shared: Studio, chromium: Browser
) -> None:
    context = chromium.new_context()
    context.add_init_script(NO_WEBGL)
    page = context.new_page()
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(shared.url)
    expect(page.locator("#flat")).to_contain_text("this browser has no WebGL")
    expect(page.locator("#flat")).to_contain_text("view from the side")
    expect(page.locator("#fps")).not_to_have_text("0")
    picture = Image.open(io.BytesIO(page.locator("#scene").screenshot()))
    assert len(picture.getcolors(1 << 20) or []) > 10  # the cranes, and edges of their lines
    context.close()
    assert faults == []


def test_a_picture_that_is_lost_is_not_shown_as_new(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own())
    page.evaluate(LOSE_WEBGL)
    expect(page.locator("#flat")).to_contain_text("has lost it): view from the side")
    before = page.locator("#scene").screenshot()
    enabled(page)
    page.keyboard.down("w")
    expect(state(page, 1, "near-far")).to_have_text("moving, shaped", timeout=SOON_MS)
    page.wait_for_timeout(500)
    page.keyboard.up("w")
    assert page.locator("#scene").screenshot() != before


def test_measured_sway_and_that_of_the_model_are_distinguished(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    studio = own()
    page = tab(studio)
    enabled(page)
    words = page.locator(".swing .quiet")
    expect(words).to_have_text(["swing, measured"] * 2)
    crane = next(p for p in studio.children("sim") if studio.groups[0] in command_of(p))
    with stopped(crane):
        expect(words.first).to_have_text("swing, by the model")
        expect(words.last).to_have_text("swing, measured")
    expect(words).to_have_text(["swing, measured"] * 2)


def test_the_shadow_shows_each_source_and_no_crane_without_a_pose(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    driven = own()
    page = tab(own("--shadow", groups=driven.groups))
    valve = page.locator("#sources li", has_text="SlewCommand")
    expect(valve.locator("b")).not_to_have_text("0/s")
    expect(page.locator("#scene")).to_be_visible()
    driven.stop()
    expect(valve.locator("b")).to_have_text("0/s")
    expect(valve).to_have_class("old")
    alone = tab(own("--shadow"))
    expect(alone.locator("#sources li", has_text="SlewCommand")).to_contain_text("never")
    expect(alone.locator("#nopose")).to_contain_text("there is no crane to draw")
    expect(alone.locator("#scene")).to_be_hidden()
