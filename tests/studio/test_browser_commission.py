"""The commissioning in a real browser: run, look, accept; on a phone nothing is cut off."""

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect

from canshaper.config.load import load_config
from tests.studio.browser import WAIT_MS
from tests.studio.conftest import ROOT, Studio
from tests.studio.languages import texts
from tests.studio.reader import LOCALES, is_good

if TYPE_CHECKING:
    from playwright.sync_api import Browser


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    text = (ROOT / "config" / "forwarder-robust.yaml").read_text()
    shutil.copy(ROOT / "dbc" / "forwarder.dbc", tmp_path)
    (tmp_path / "machine.yaml").write_text(text.replace("../dbc/", ""))
    return tmp_path / "machine.yaml"


def test_a_step_is_run_and_accepted(chromium: "Browser", machine: Path) -> None:
    studio = Studio(file=str(machine))
    try:
        tab = chromium.new_page(viewport={"width": 390, "height": 800})
        tab.set_default_timeout(WAIT_MS)
        faults: list[str] = []
        tab.on("console", lambda message: faults.append(message.text))
        tab.on("pageerror", lambda error: faults.append(str(error)))
        tab.goto(f"{studio.url}commission")
        tab.locator("#steps button", has_text="check").click()
        tab.locator("#run:not([disabled])").click()
        tab.locator("#accept:not([hidden]):not([disabled])").click()
        tab.locator("#steps .done", has_text="check").wait_for()
        assert "max_pct: 40" in machine.with_name("machine.rehearsal.yaml").read_text()
        tab.locator("#steps button", has_text="check").click()
        assert "max_pct: 40" in tab.locator("#diff ins").all_inner_texts()[-1]
        width = tab.evaluate("document.documentElement.scrollWidth")
        assert width <= 390
        tab.locator("#pictures img").wait_for()
        for one in tab.locator("#steps button").all():
            one.click()
            assert tab.locator("header a[href='/']").is_visible()
        tab.click("header a[href='/']")
        expect(tab.locator("#seat")).to_have_text("you drive: press enable")
        assert faults == []
        tab.close()
    finally:
        studio.stop()


def test_both_filters_are_offered_and_the_chosen_one_is_written(
    chromium: "Browser", machine: Path
) -> None:
    studio = Studio(file=str(machine))
    try:
        tab = chromium.new_page(viewport={"width": 1440, "height": 900})
        tab.set_default_timeout(WAIT_MS)
        tab.goto(f"{studio.url}commission")
        tab.locator("#steps button", has_text="filter").click()
        tab.locator("#run:not([disabled])").click()
        choice = tab.locator("#choice:not([disabled])")
        choice.wait_for()
        recommended = choice.input_value()
        other = "gff" if recommended == "robust" else "robust"
        offered = tab.locator("#choice option").all_inner_texts()
        assert sorted(offered) == sorted([f"{recommended} (recommended)", other])
        choice.select_option(other)
        tab.locator("#parts", has_text=f"Recommended: {recommended}. Chosen: {other}").wait_for()
        tab.locator("#accept:not([hidden]):not([disabled])").click()
        tab.locator("#steps .done", has_text="filter").wait_for()
        axes = load_config(machine.with_name("machine.rehearsal.yaml"))[0].axes
        assert {axes[name].filter.kind for name in ("slew", "near_far")} == {other}
        tab.close()
    finally:
        studio.stop()


def test_it_speaks_every_language(chromium: "Browser", machine: Path) -> None:
    """What the procedure itself says is English, and marked as such."""
    studio = Studio(file=str(machine))
    try:
        for language, locale in LOCALES.items():
            context = chromium.new_context(locale=locale, viewport={"width": 390, "height": 800})
            page, table = context.new_page(), texts(language)
            page.goto(f"{studio.url}commission")
            expect(page.locator("#title")).to_have_text(table["step.buses"])
            expect(page.locator("#run")).to_have_text(table["commission.run"])
            expect(page.locator("#steps small").first).to_have_text(table["status.open"])
            is_good(page, language)
            context.close()
    finally:
        studio.stop()
