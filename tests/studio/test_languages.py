"""The texts of the page: every language has every text, and the page has no text besides."""

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from canshaper.commissioning.procedure.procedure import STEPS
from canshaper.shaping.reasons import REASON_TEXTS, STATE_TEXTS
from canshaper.studio.server import STATIC
from canshaper.studio.words import said
from tests.studio.languages import ENGLISH, OTHERS, PLACE, texts

KEY = re.compile(r"""data-t(?:-\w+)?="([\w.]+)"|["`]([a-z]\w*(?:\.\w+)+)["`]""")
NOT_TEXTS = re.compile(r"\.(js|csv|png|json)$")
# Keys that scripts put together, by what they begin with.
COMPOSED = ("axis.", "way.", "crane.", "slider.", "stick.", "gamepad.", "chart.a")
COMPOSED += ("status.", "step.", "said.", "level.", "study.", "chart.hall.")
NAMES = {"canshaper", "canshaper studio", "Commissioning, canshaper studio", "studio"}
NAMES |= {"CSV", "PNG", "A/B"}


def test_there_are_the_languages_that_the_page_offers() -> None:
    languages = {path.stem for path in (STATIC / "languages").iterdir()}
    assert languages == {ENGLISH, *OTHERS}
    offered = re.search(r"LANGUAGES = \{(.*?)\}", (STATIC / "language.js").read_text())
    assert offered and set(re.findall(r"(\w+):", offered[1])) == languages


@pytest.mark.parametrize("language", OTHERS)
def test_every_language_has_every_text_with_its_placeholders(language: str) -> None:
    english = texts(ENGLISH)
    own = {key: text for key, text in texts(language).items() if not key.startswith("term.")}
    assert list(own) == list(english)
    for key, text in own.items():
        assert text.strip() and sorted(PLACE.findall(text)) == sorted(PLACE.findall(english[key]))


@pytest.mark.parametrize("language", OTHERS)
def test_states_and_reasons_are_those_of_the_daemon(language: str) -> None:
    """One that has no words in a language yet is shown in English."""
    terms = {key[5:] for key, text in texts(language).items() if key.startswith("term.") and text}
    daemon = {one.words for one in (*STATE_TEXTS.values(), *REASON_TEXTS.values())}
    assert terms and terms <= daemon


def keys_of(path: Path) -> set[str]:
    """Keys of texts in a page or script."""
    used = {one or other for one, other in KEY.findall(path.read_text())}
    return {key for key in used if not NOT_TEXTS.search(key)}


def test_the_page_uses_every_text_and_no_other() -> None:
    keys = set(texts(ENGLISH))
    used: set[str] = set()
    for path in (*STATIC.glob("*.js"), *STATIC.glob("*.html")):
        used |= keys_of(path)
    assert used <= keys
    assert [key for key in keys - used if not key.startswith(COMPOSED)] == []


def test_the_studio_says_every_text_that_there_is_for_it_and_no_other() -> None:
    there = {key[5:] for key in texts(ENGLISH) if key.startswith("said.")}
    source = "".join(path.read_text() for path in STATIC.parent.glob("*.py"))
    assert set(re.findall(r'\bsaid\(\s*"(\w+)"', source)) | {"off"} == there
    assert 'said("on" if on else "off")' in source


def test_what_the_studio_says_is_one_of_the_texts_only() -> None:
    """The page finds the text of its language by the English one."""
    english = {key[5:]: text for key, text in texts(ENGLISH).items() if key.startswith("said.")}
    for key, template in english.items():
        spoken = said(key, **{place[1:-1]: "x y" for place in PLACE.findall(template)})
        assert [one for one, text in english.items() if pattern(text).fullmatch(spoken)] == [key]


def pattern(template: str) -> re.Pattern[str]:
    return re.compile(".+?".join(re.escape(part) for part in PLACE.split(template)))


class Words(HTMLParser):
    """Words that stand in a page itself."""

    def __init__(self) -> None:
        super().__init__()
        self.texts: set[str] = set()
        self._key = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._key = tag == "kbd"
        self.texts |= {value for name, value in attrs if name in ("title", "aria-label") and value}

    def handle_data(self, data: str) -> None:
        if re.search(r"[A-Za-z]", data) and not self._key:
            self.texts.add(data.strip())
        self._key = False


@pytest.mark.parametrize("page", ["index.html", "commission.html"])
def test_the_page_itself_has_names_only(page: str) -> None:
    words = Words()
    words.feed((STATIC / page).read_text())
    assert words.texts <= NAMES


def test_every_step_of_the_commissioning_has_its_title() -> None:
    titles = {key[5:]: text for key, text in texts(ENGLISH).items() if key.startswith("step.")}
    assert titles == {step.name: step.title for step in STEPS}
