"""The numbers of a running machine, in a real browser."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from tests.studio.conftest import Studio
from tests.studio.languages import OTHERS, texts
from tests.studio.machine import A1, PERIOD, Machine
from tests.studio.reader import english_said, in_language


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Machine]:
    one = Machine(tmp_path)
    yield one
    one.stop()


def test_numbers_are_set_compared_undone_and_written(
    machine: Machine, tab: Callable[..., Page]
) -> None:
    page = tab(machine.studio)
    before = machine.now(PERIOD)
    now = page.locator(f"#numbers tr:has(td:text-is('{PERIOD}')) td").nth(1)
    field = page.get_by_label(f"Another value of {PERIOD}")
    expect(now).to_have_text(f"{before:g}")
    page.get_by_label("Your name").fill("Aino Nex")  # no letter of it is a key of the page
    field.fill("9")
    expect(page.locator("#numbers .set")).to_be_disabled()
    field.fill("2.5")
    page.click("#numbers .set")
    expect(now).to_have_text("2.5")
    assert machine.now(PERIOD) == 2.5
    expect(page.locator(".changes li").first).to_contain_text(f"Aino Nex{PERIOD} {before:g} → 2.5")
    page.click("#numbers .swap")
    expect(now).to_have_text(f"{before:g}")
    page.click("#numbers .swap")
    expect(now).to_have_text("2.5")
    page.click("#numbers .undo")
    expect(now).to_have_text(f"{before:g}")
    page.click("#numbers .undo")
    expect(now).to_have_text("2.5")
    page.get_by_label(f"Another value of {A1}").fill("0.7")
    page.keyboard.press("Tab")
    page.click("#numbers .set")
    expect(page.locator(".changes li").first).to_contain_text(f"{A1} ")
    # Nothing is written before its lines were seen.
    text = machine.file.read_text()
    page.click("#numbers .write")
    expect(page.locator("dialog .ok", has_text="2.5")).to_have_count(1)
    page.click("dialog .cancel")
    expect(page.locator("dialog")).to_be_hidden()
    assert machine.file.read_text() == text
    page.click("#numbers .write")
    page.click("dialog .really")
    expect(page.locator("#events")).to_contain_text("Aino Nex wrote")
    assert machine.in_file("period_s") == 2.5
    page.click("#numbers .write")
    expect(page.locator("dialog")).to_contain_text("nothing: the file has the numbers")
    expect(page.locator("dialog .really")).to_be_disabled()


def test_axe_finds_nothing(machine: Machine, tab: Callable[..., Page]) -> None:
    page = tab(machine.studio)
    page.get_by_label(f"Another value of {PERIOD}").fill("2.5")
    page.click("#numbers .set")
    expect(page.locator(".changes li")).to_have_count(1)
    violations = Axe().run(page).response["violations"]
    assert [(one["id"], [n["target"] for n in one["nodes"]]) for one in violations] == []


def test_a_machine_that_is_only_listened_to_has_none(
    own: Callable[..., Studio], tab: Callable[..., Page]
) -> None:
    page = tab(own("--shadow"))
    expect(page.locator("#numbers")).to_be_hidden()


def test_they_are_in_the_language(machine: Machine, tab: Callable[..., Page]) -> None:
    for language in OTHERS:
        page = in_language(tab, machine.studio, language)
        other = texts(language)["numbers.anotherOf"].replace("{key}", PERIOD)
        expect(page.get_by_label(other)).to_be_visible()
        assert english_said(page, language) == []
