"""Chromium for the tests and pictures of the page: Debian's, installed where that is possible."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Locator, Page, expect, sync_playwright

from tests.lane.outcome import NoLane
from tests.lane.packages import install, missing
from tests.studio.page import DISTURBED, TRIES

PROGRAMS = {"chromium": "chromium"}
FLAGS = [
    "--no-sandbox",  # root may have no other
    "--disable-background-networking",
    # There is no graphics card on a build machine.
    "--disable-gpu",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
# Only to end a test that hangs.
WAIT_MS = 60_000
expect.set_options(timeout=WAIT_MS)
CONNECTED = re.compile("^(connected|opened|daemon silent: machine)$")
NO_GAMEPAD = "() => { navigator.getGamepads = () => []; }"
SOON_MS = 10_000


class NoBrowserError(Exception):
    """There is no Chromium, and it cannot be installed; the message says why."""


@contextmanager
def browser() -> Iterator[Browser]:
    """A headless Chromium.

    Raises:
        NoBrowserError: there is none.
    """
    try:
        install(missing(PROGRAMS))
    except NoLane as error:
        raise NoBrowserError(str(error)) from None
    with sync_playwright() as playwright:
        one = playwright.chromium.launch(
            executable_path=str(Path(__file__).parent / "chromium.sh"), args=FLAGS
        )
        try:
            yield one
        finally:
            one.close()


def opened(
    one: Browser, url: str, faults: list[str], shown: re.Pattern[str] = CONNECTED, **options: Any
) -> Page:
    """A tab with the page; errors of the console, of scripts and of requests go to ``faults``.

    Args:
        shown: what the page says of its connection when it is open.
        options: of the context, such as viewport and locale.
    """
    page = one.new_context(**options).new_page()
    page.set_default_timeout(WAIT_MS)
    host = url.split("/")[2]

    def console(message: Any) -> None:
        if message.type == "error":
            faults.append(message.text)

    def on_request(request: Any) -> None:
        if not re.match(rf"(http|ws)://{re.escape(host)}/|blob:|data:", request.url):
            faults.append(f"asks for {request.url}")

    page.on("console", console)
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("request", on_request)
    page.on("requestfailed", lambda request: faults.append(f"failed: {request.url}"))
    page.on("response", lambda a: faults.append(f"{a.status} {a.url}") if a.status > 399 else None)
    page.goto(url)
    expect(page.locator("#link")).to_have_text(shown, timeout=WAIT_MS)
    return page


def enabled(page: Page) -> None:
    """Drive, with the axes ready. Enable of the driver before is released first."""
    expect(page.locator("#seat")).to_have_text("you drive: press enable")
    page.keyboard.press("e")
    expect(page.locator("#seat")).to_have_text("you drive")
    expect(page.locator("#axes .state[data-level=ready]")).to_have_count(6)


def swing(page: Page, crane: str) -> float:
    return float(page.inner_text(f"#swing-{crane}").strip("±°"))


def ready_again(page: Page) -> None:
    """Take the seat where it was lost, and wait until every axis is ready."""
    if page.inner_text("#seat") != "you drive":
        enabled(page)
    expect(page.locator("#axes .state[data-level=ready]")).to_have_count(6)


def undisturbed(page: Page, drive: Callable[[], None]) -> None:
    """Drive; where a busy machine held up page or joysticks too long, let go and drive again.

    Where it did so each time, the test is skipped with that reason: at rest the axes are.
    """
    disturbed = page.locator("#events li", has_text=DISTURBED)
    for _ in range(TRIES):
        ready_again(page)
        before = disturbed.count()
        try:
            drive()
        except AssertionError:
            if disturbed.count() == before:
                raise
        if disturbed.count() == before:
            return
        print("the machine was busy; driven again")
        page.mouse.up()
        for key in ("a", "ArrowUp"):
            page.keyboard.up(key)
        page.evaluate(NO_GAMEPAD)
        page.wait_for_timeout(4000)  # by then enable is released, or kept
    ready_again(page)
    pytest.skip(f"the machine was too busy in each of {TRIES} drives")


def state(page: Page, crane: int, axis: str = "slew") -> Locator:
    """The words of an axis: crane 1 is the shaped one, 2 the raw one."""
    return page.locator(f"#axes tr:has(td:text-is('{axis}')) td").nth(crane).locator(".state")
