"""The page in a real browser, with real daemons and cranes behind it."""

import os
import re
import signal
import time
from collections.abc import Callable

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.studio.browser import (
    NO_GAMEPAD,
    SOON_MS,
    enabled,
    opened,
    state,
    swing,
    undisturbed,
)
from tests.studio.conftest import Studio, command_of
from tests.studio.page import WAIT_S

DAEMON_SILENT = re.compile("daemon silent: shaped")


@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_it_loads_without_an_error_and_requests_nothing_elsewhere(
    shared: Studio, tab: Callable[..., Page], scheme: str
) -> None:
    page = tab(shared, color_scheme=scheme, viewport={"width": 1024, "height": 700})
    expect(page).to_have_title("canshaper studio")
    assert page.evaluate("document.documentElement.dataset.theme") == scheme
    expect(page.locator("#fps")).not_to_have_text("0")
    # Nothing is cut off at the smallest width.
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert page.evaluate("document.documentElement.scrollHeight <= innerHeight")
    for name in ("#pads svg", "#sliders input", "#chart-command canvas", "#scene", "#events"):
        for one in page.locator(name).all():
            box = one.bounding_box()
            assert box and box["width"] > 40 and box["height"] > 10, name
            assert box["x"] >= 0 and box["x"] + box["width"] <= 1024, name
            assert box["y"] >= 0 and box["y"] + box["height"] <= 700, name


def test_keys_drive_both_cranes_and_the_shaped_one_swings_less(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own())
    before = page.locator("#scene").screenshot()

    def drive() -> None:
        page.keyboard.down("a")
        page.wait_for_timeout(900)
        page.keyboard.up("a")
        expect(page.locator("#axes .state[data-level=ready]")).to_have_count(6)
        page.wait_for_timeout(3000)
        raw, shaped = swing(page, "raw"), swing(page, "shaped")
        assert raw > 10.0
        assert shaped < raw / 4

    undisturbed(page, drive)
    assert page.locator("#scene").screenshot() != before


def test_the_mouse_moves_a_joystick_and_letting_go_stops_it(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own())
    pad = page.locator("#pad1").bounding_box()
    assert pad
    x, y = pad["x"] + pad["width"] / 2, pad["y"] + pad["height"] / 2

    def drive() -> None:
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x, y - 30, steps=5)
        expect(state(page, 1, "lift")).to_have_text("moving, shaped", timeout=SOON_MS)
        page.mouse.up()
        expect(state(page, 1, "lift")).to_have_text("ready", timeout=SOON_MS)

    undisturbed(page, drive)


def test_a_gamepad_drives(own: Callable[..., Studio], tab: Callable[..., Page]) -> None:
    page = tab(own())

    def drive() -> None:
        page.evaluate(
            "() => { navigator.getGamepads ="
            " () => [{ connected: true, axes: [0.05, -0.6, 0, 0.05] }, null]; }"
        )
        expect(state(page, 1, "near-far")).to_have_text("moving, shaped", timeout=SOON_MS)
        expect(state(page, 1, "slew")).to_have_text("ready")  # within the dead zone
        page.evaluate(NO_GAMEPAD)
        expect(state(page, 1, "near-far")).to_have_text("ready", timeout=SOON_MS)

    undisturbed(page, drive)


GAMEPAD = """(down) => { navigator.getGamepads = () => [{
    connected: true, id: "pad", mapping: "standard", axes: [0, 0, 0, 0],
    buttons: [0, 1, 2, 3].map((n) => ({ pressed: n === down })) }]; }"""


def test_buttons_of_a_gamepad_enable_stop_and_switch_anti_sway(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own())
    seat, none = page.locator("#seat"), -1
    expect(seat).to_have_text("you drive: press enable")
    expect(page.locator("#gamepad")).to_be_hidden()

    def press(button: int) -> None:
        page.evaluate(GAMEPAD, button)
        page.wait_for_timeout(100)
        page.evaluate(GAMEPAD, none)
        page.wait_for_timeout(100)

    page.evaluate(GAMEPAD, 0)  # one that is held while the gamepad is found does nothing
    expect(page.locator("#gamepad")).to_contain_text("enable")
    page.wait_for_timeout(500)
    expect(seat).to_have_text("you drive: press enable")
    page.evaluate(GAMEPAD, none)
    page.wait_for_timeout(100)
    press(0)
    expect(seat).to_have_text("you drive")
    press(0)  # it is no toggle
    expect(seat).to_have_text("you drive")
    press(2)
    expect(page.locator("#antisway")).to_have_attribute("aria-pressed", "false")
    expect(page.locator("#antisway b")).to_have_text("off")
    press(2)
    expect(page.locator("#antisway")).to_have_attribute("aria-pressed", "true")
    press(1)
    expect(seat).to_have_text("you drive: press enable")
    page.evaluate(NO_GAMEPAD)
    expect(page.locator("#gamepad")).to_be_hidden()


def test_anti_sway_is_switched_in_motion(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own())

    def drive() -> None:
        if page.get_attribute("#antisway", "aria-pressed") == "false":
            page.keyboard.press("n")
        page.keyboard.down("a")
        expect(state(page, 1)).to_have_text("moving, shaped", timeout=SOON_MS)
        page.keyboard.press("n")
        expect(page.locator("#antisway")).to_have_attribute("aria-pressed", "false")
        expect(state(page, 1)).to_have_text("moving, unshaped", timeout=SOON_MS)
        page.keyboard.press("n")
        expect(page.locator("#antisway")).to_have_attribute("aria-pressed", "true")
        expect(state(page, 1)).to_have_text("moving, shaped", timeout=SOON_MS)
        page.keyboard.up("a")

    undisturbed(page, drive)


def test_space_stops_and_a_page_without_focus_lets_go(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own())

    def drive() -> None:
        page.keyboard.down("ArrowUp")
        expect(state(page, 1, "lift")).to_have_text("moving, shaped", timeout=SOON_MS)
        page.evaluate("dispatchEvent(new Event('blur'))")
        expect(state(page, 1, "lift")).to_have_text("ready", timeout=SOON_MS)
        page.keyboard.up("ArrowUp")
        page.keyboard.down("ArrowUp")
        expect(state(page, 1, "lift")).to_have_text("moving, shaped", timeout=SOON_MS)
        page.keyboard.press(" ")
        expect(state(page, 1, "lift")).to_have_text("tripped: neutral", timeout=SOON_MS)
        page.keyboard.up("ArrowUp")
        # Enable again is the way back.
        page.keyboard.press("e")
        expect(state(page, 1, "lift")).to_have_text("ready", timeout=SOON_MS)

    undisturbed(page, drive)


def test_a_slider_is_felt_by_the_daemon(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own())
    slider = page.locator("#slider-length")
    expect(slider).to_be_enabled()
    slider.focus()
    page.keyboard.press("End")
    expect(page.locator("#events")).to_contain_text("axes.slew.sway.period_s = 3.332")
    page.wait_for_timeout(1500)  # by then it shows what the daemon has
    assert slider.input_value() == "1"
    back = page.locator(".slider .back").last
    back.click()
    expect(page.locator("#events li").last).to_contain_text("axes.slew.sway.period_s = 2.356")
    expect(back).to_be_disabled()
    assert slider.input_value() == "0"


def test_a_second_tab_takes_the_joysticks(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    studio = own()
    first = tab(studio)
    enabled(first)
    first.locator("#slider-length").focus()
    first.keyboard.press("End")
    expect(first.locator("#events")).to_contain_text("axes.slew.sway.period_s = 3.332")
    second = tab(studio)
    expect(second.locator("#seat")).to_have_text("another page drives")
    expect(second.locator("#enable")).to_be_disabled()
    second.click("#take")
    expect(first.locator("#seat")).to_have_text("another page drives")
    enabled(second)
    # What the driver before has changed is put back.
    expect(second.locator("#events")).to_contain_text("axes.slew.sway.period_s = 2.356")
    expect(second.locator(".slider b").last).to_contain_text("1.00")


def test_the_page_is_back_when_the_daemon_is_back_and_when_the_studio_is(
    own: Callable[..., Studio], chromium: Browser
) -> None:
    studio, faults = own(), list[str]()
    page = opened(chromium, studio.url, faults)
    enabled(page)
    daemon = next(p for p in studio.children("run") if studio.groups[0] in command_of(p))
    os.kill(daemon, signal.SIGKILL)
    expect(page.locator("#link")).to_have_text(DAEMON_SILENT)
    expect(page.locator("#link")).to_have_text("connected")
    expect(page.locator("#events")).to_contain_text("canshaper run ended with status -9")
    assert faults == []
    port = studio.port
    studio.stop()
    expect(page.locator("#banner")).to_contain_text("No connection to the studio")
    limit = time.monotonic() + WAIT_S
    studio.start(port)
    expect(page.locator("#link")).to_have_text("connected")
    expect(page.locator("#banner")).to_be_hidden()
    enabled(page)
    assert time.monotonic() < limit
    # The browser reports every connection that was refused meanwhile, and nothing else.
    assert all("ERR_CONNECTION_REFUSED" in fault for fault in faults), faults
    page.context.close()


def test_nothing_can_be_driven_in_the_shadow(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own("--shadow"))
    expect(page.locator("#file")).to_have_text("forwarder.yaml — listening only")
    for hidden in ("#controls", "#hands", "#view"):
        expect(page.locator(hidden)).to_be_hidden()
    expect(page.locator("#axes .state")).to_have_text(["daemon silent"] * 3)
    expect(page.locator("#note")).to_contain_text("not on the bus")


def test_the_button_says_which_profile_is_chosen(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own(file="j1939-profiles.yaml"))
    button = page.locator("#profile")
    expect(button).to_have_text("P Profile normal")
    button.click()
    expect(button).to_have_text("P Profile quick")
    page.keyboard.press("p")
    expect(button).to_have_text("P Profile fine")


def test_without_profiles_there_is_no_button(shared: Studio, tab: Callable[..., Page]) -> None:
    page = tab(shared)
    expect(page.locator("#reset")).to_be_visible()
    expect(page.locator("#profile")).to_be_hidden()


def test_the_slider_of_settings_says_what_each_leaves(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own())
    slider, words = page.locator("#slider-preference"), page.locator(".slider .numbers").first
    expect(slider).to_be_enabled(timeout=120_000)
    in_file = words.inner_text()
    assert re.search(r"near-far: leaves \d+ % of the swing, runs on [\d.]+ m, still", in_file)
    slider.focus()
    page.keyboard.press("End")
    expect(page.locator("#events")).to_contain_text("at the next standstill")
    page.wait_for_timeout(1500)  # by then it shows what the studio has
    assert slider.input_value() == "1"
    calm = words.inner_text()
    assert calm != in_file
    back = page.locator(".slider .back").first
    back.click()
    expect(back).to_be_disabled()
    expect(words).to_have_text(in_file)
