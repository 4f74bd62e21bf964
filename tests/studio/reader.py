"""A person who reads the page in a language."""

import re
from collections.abc import Callable

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page

from tests.studio.conftest import Studio
from tests.studio.languages import ENGLISH, PLACE, texts

LOCALES = {"en": "en-GB", "de": "de-AT", "fi": "fi-FI", "sv": "sv-SE"}
# What can be read or is read out, but for what is marked as English.
SAID = """() => {
    const said = [];
    for (const one of document.querySelectorAll("body, body *")) {
        if (one.closest("[lang=en], #language")) continue;
        said.push(one.title, one.getAttribute("aria-label"));
        for (const node of one.childNodes) if (node.nodeType === 3) said.push(node.data);
    }
    return [...new Set(said.map((text) => text?.trim()).filter(Boolean))];
}"""
CUT_OFF = """() => [...document.querySelectorAll("body *")].filter((one) => one.offsetParent
    && (one.getBoundingClientRect().right > innerWidth + 1
        || (one.matches("button, select, .pill, a") && one.scrollWidth > one.clientWidth + 1
            && one.clientWidth > 0))).map((one) => one.outerHTML.slice(0, 90))"""


def in_language(tab: Callable[..., Page], studio: Studio, language: str) -> Page:
    """A phone of a person who reads that language."""
    shown = re.compile(f"^{texts(language)['link.connected']}$")
    size = {"width": 390, "height": 844}
    return tab(studio, shown=shown, locale=LOCALES[language], viewport=size)


def english_said(page: Page, language: str) -> list[str]:
    """English texts of the page although its language has a text of its own."""
    english, own = texts(ENGLISH), texts(language)
    said, untranslated = page.evaluate(SAID), []
    for key, text in english.items():
        if text != own[key]:
            pattern = re.compile(".+".join(re.escape(part) for part in PLACE.split(text)))
            untranslated += [
                one for one in said if pattern.fullmatch(one) and one not in own.values()
            ]
    return untranslated


def is_good(page: Page, language: str) -> None:
    """Nothing is English or cut off, and axe reports no violation."""
    if language != ENGLISH:
        assert english_said(page, language) == []
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert page.evaluate(CUT_OFF) == []
    violations = Axe().run(page).response["violations"]
    assert [(one["id"], [n["target"] for n in one["nodes"]]) for one in violations] == []
