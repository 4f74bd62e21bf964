"""The page in each of its languages, in a real browser."""

import json
import os
import signal
from collections.abc import Callable

import pytest
from playwright.sync_api import Browser, Page, Route, expect

from tests.studio.browser import SOON_MS
from tests.studio.conftest import Studio
from tests.studio.languages import ENGLISH, OTHERS, texts
from tests.studio.reader import english_said, in_language, is_good

TERMS = ("ready", "joystick in neutral")
STAND_STILL = "ms => { const t = performance.now(); while (performance.now() - t < ms); }"


@pytest.mark.parametrize("language", [ENGLISH, *OTHERS])
def test_the_page_speaks_the_language_of_the_browser(
    own: Callable[..., Studio], tab: Callable[..., Page], language: str
) -> None:
    """At rest, driven, after it stood still, and when the studio is gone."""
    studio, table = own(), texts(language)
    ready_words, neutral = (table.get(f"term.{one}", one) for one in TERMS)
    page = in_language(tab, studio, language)
    assert page.get_attribute("html", "lang") == language
    assert page.input_value("#language") == language
    expect(page.locator("#fps")).not_to_have_text("0")
    expect(page.locator("#seat")).to_have_text(table["seat.enable"])
    is_good(page, language)
    page.keyboard.press("e")
    expect(page.locator("#seat")).to_have_text(table["seat.drive"])
    ready = page.locator("#axes tr:nth-child(2) td:nth-child(2)")
    expect(ready.locator(".state")).to_have_text("ready")  # the daemon's term
    meaning = f"{ready_words}: {neutral}"
    expect(ready.locator(".means")).to_have_text("" if language == ENGLISH else meaning)
    expect(page.locator("#language")).to_be_disabled()
    # What the studio says, and a state with its reason; the key of an axis is no word.
    words = f"{table['axis.slew']}: {ready_words} — {neutral}"
    expect(page.locator("#events li", has_text=words).first).to_be_visible()
    expect(page.locator("#events li", has_text=table["said.daemon"]).first).to_be_visible()
    page.evaluate(STAND_STILL, 900)
    stood = table["hiccup.stood"].split("{s}")[0].strip()
    said = page.locator("#events li", has_text=stood)
    expect(said.first).to_be_attached(timeout=SOON_MS)
    is_good(page, language)
    os.kill(studio.process.pid, signal.SIGSTOP)
    try:
        expect(page.locator("#link")).to_have_text(table["link.none"])
        expect(page.locator("#banner")).to_contain_text(table["banner.neutral"])
        is_good(page, language)
    finally:
        os.kill(studio.process.pid, signal.SIGCONT)
    expect(page.locator("#link")).to_have_text(table["link.connected"])


def test_views_and_axes_are_in_the_language(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = in_language(tab, own(), "fi")
    for view, words in (("#above", "#plan"), ("#left", "#residual-words")):
        page.click(view)
        expect(page.locator(words)).to_be_visible()
        page.wait_for_timeout(1000)
        assert english_said(page, "fi") == []
    expect(page.locator("#residual-words")).to_contain_text("Suodin olettaa")
    page.click("#tabs [data-axis=lift]")
    expect(page.locator("#residual-words")).to_have_text(texts("fi")["left.none"])
    with page.expect_download() as download:
        page.click("#csv")
    head = download.value.path().read_text().partition("\n")[0]
    assert "slew command joystick" in head and "lift sway shaped" in head  # names of the file


def test_the_language_is_chosen_and_kept(shared: Studio, tab: Callable[..., Page]) -> None:
    page = tab(shared)
    page.click("#more summary")
    page.select_option("#language", "sv")  # the page begins again
    expect(page.locator("#link")).to_have_text(texts("sv")["link.connected"])
    page.reload()
    expect(page.locator("#reset")).to_contain_text(texts("sv")["button.reset"])
    assert page.get_attribute("html", "lang") == "sv"


@pytest.mark.parametrize("lost", ["a key", "the table"])
def test_what_a_language_lacks_is_english(shared: Studio, chromium: Browser, lost: str) -> None:
    table = texts("sv")
    del table["button.reset"]

    def answer(route: Route) -> None:
        if lost == "a key":
            route.fulfill(content_type="application/json", body=json.dumps(table))
        else:
            route.fulfill(status=404)

    page = chromium.new_context(locale="sv-SE").new_page()
    page.route("**/languages/sv.json", answer)
    page.goto(shared.url)
    expect(page.locator("#reset span")).to_have_text("Reset")
    other = table["button.enable"] if lost == "a key" else "Enable"
    expect(page.locator("#enable span")).to_have_text(other)
    page.context.close()
