"""Chromium for the tests and pictures of the page: Debian's, installed where that is possible."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page, expect, sync_playwright

from tests.lane.outcome import NoLane
from tests.lane.packages import install, missing

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


def opened(one: Browser, url: str, faults: list[str], **options: Any) -> Page:
    """A tab with the page; errors of the console, of scripts and of requests go to ``faults``."""
    page = one.new_context(**options).new_page()
    page.set_default_timeout(WAIT_MS)
    host = url.split("/")[2]

    def console(message: Any) -> None:
        if message.type == "error":
            faults.append(message.text)

    def request(asked: Any) -> None:
        if not re.match(rf"(http|ws)://{re.escape(host)}/|blob:|data:", asked.url):
            faults.append(f"asks for {asked.url}")

    page.on("console", console)
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("request", request)
    page.on("requestfailed", lambda asked: faults.append(f"failed: {asked.url}"))
    page.on("response", lambda a: faults.append(f"{a.status} {a.url}") if a.status > 399 else None)
    page.goto(url)
    expect(page.locator("#link")).to_have_text("connected", timeout=WAIT_MS)
    return page
