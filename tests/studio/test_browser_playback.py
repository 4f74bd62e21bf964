"""The page of a drive that is over: time bar, charts, states, events, another drive."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from tests.studio.conftest import Opened, Studio
from tests.studio.drives import black_box, recorded
from tests.studio.languages import OTHERS, texts
from tests.studio.reader import LOCALES, is_good

SIZES = [(390, 844), (1024, 700), (1920, 1080)]


@pytest.fixture
def box(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Opened]:
    """The black box of a trip, with another deployment next to it."""
    path = black_box(tmp_path, monkeypatch)
    studio = Opened(str(path), "--with", "forwarder-robust.yaml")
    yield studio
    studio.stop()


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Opened]:
    """A log with the pose of its crane, and one deployment."""
    path = recorded(tmp_path_factory.mktemp("drive") / "drive.log")
    studio = Opened(str(path), "--with", "forwarder-robust.yaml")
    yield studio
    studio.stop()


def at_s(page: Page) -> float:
    return float(page.inner_text("#at").split(" s")[0])


def slew(page: Page, crane: int) -> str:
    return page.locator("#axes tr:has(td:text-is('slew')) td .state").nth(crane).inner_text()


def test_a_black_box_is_looked_at_event_by_event(box: Opened, tab: Callable[..., Page]) -> None:
    page = tab(box)
    expect(page.locator("#file")).to_have_text("machine-0001.zip — a drive that is over")
    expect(page.locator("#axes th")).to_have_text(["axis", "machine", "forwarder-robust"])
    for hidden in ("#controls", "#hands", "#pause", "#seat"):
        expect(page.locator(hidden)).to_be_hidden()
    assert at_s(page) == 0.0
    states = [slew(page, 0)]
    while True:
        before = at_s(page)
        page.click("#after")
        if at_s(page) == before:
            break
        states.append(slew(page, 0))
    assert "moving, shaped" in states
    assert states.index("moving, shaped") < states.index("tripped: neutral")
    page.click("#before")
    assert at_s(page) < before
    expect(page.locator("#events li", has_text="tripped")).to_have_count(2)
    page.click("#about summary")
    expect(page.locator("#notes")).to_contain_text("frames compared, all the same")
    expect(page.locator("#notes")).to_contain_text("the black box is of other files")


def test_the_time_bar_moves_cranes_and_charts(log: Opened, tab: Callable[..., Page]) -> None:
    page = tab(log)
    page.keyboard.press("ArrowRight")
    expect(page.locator(".swing .quiet").first).to_have_text("swing, measured")
    expect(page.locator(".swing .quiet").last).to_have_text("swing, simulated")
    page.wait_for_timeout(500)
    scene, chart = (page.locator(s).screenshot() for s in ("#scene", "#chart-command"))
    page.locator("#time").focus()
    for _ in range(24):
        page.keyboard.press("ArrowRight")
    assert at_s(page) == pytest.approx(5.0, abs=0.1)
    page.wait_for_timeout(500)
    assert page.locator("#scene").screenshot() != scene
    assert page.locator("#chart-command").screenshot() != chart
    # A click into a chart goes there.
    over = page.locator("#chart-sway .u-over").bounding_box()
    assert over
    page.mouse.click(over["x"] + over["width"] / 2, over["y"] + 20)
    assert at_s(page) == pytest.approx(10.0, abs=0.2)
    page.keyboard.press("End")
    end = at_s(page)
    assert end > 15.0
    page.keyboard.press("Home")
    assert at_s(page) == 0.0


def test_it_plays_and_stops_at_the_end(log: Opened, tab: Callable[..., Page]) -> None:
    page = tab(log)
    page.select_option("#speed", "5")
    page.click("#play")
    expect(page.locator("#play")).to_have_text("Stop")
    expect(page.locator("#at")).to_have_text(re.compile(r"^([3-9]|1[0-2])\."))
    page.click("#play")
    stood = at_s(page)
    page.wait_for_timeout(400)
    assert at_s(page) == stood
    page.locator("#play").blur()
    page.keyboard.press("Space")
    expect(page.locator("#play")).to_have_text("Play")  # it is over
    assert at_s(page) > 15.0


def test_another_drive_of_a_campaign_is_chosen(tab: Callable[..., Page]) -> None:
    studio = Opened("forwarder.yaml", "--seed", "3", "--seed", "4")
    try:
        page = tab(studio)
        expect(page.locator("#title")).to_contain_text("drive 3: ")
        page.select_option("#drive", label="drive 4")
        expect(page.locator("#title")).to_contain_text("drive 4: ")
        expect(page.locator("#link")).to_have_text("opened")
        assert page.locator("#axes th").all_inner_texts() == ["axis", "forwarder", "raw"]
    finally:
        studio.stop()


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_nothing_is_cut_off(log: Opened, tab: Callable[..., Page], width: int, height: int) -> None:
    page = tab(log, viewport={"width": width, "height": height})
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    for name in ("#playback button", "#time", "#scene", ".chart"):
        for one in page.locator(name).all():
            box = one.bounding_box()
            assert box and box["x"] >= 0 and box["x"] + box["width"] <= width, name
            assert box["height"] > 10, name


@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_axe_finds_nothing(log: Opened, tab: Callable[..., Page], scheme: str) -> None:
    page = tab(log, color_scheme=scheme)
    violations = Axe().run(page).response["violations"]
    assert [(one["id"], [n["target"] for n in one["nodes"]]) for one in violations] == []


@pytest.mark.parametrize("language", OTHERS)
def test_it_is_in_the_language(log: Opened, tab: Callable[..., Page], language: str) -> None:
    table, size = texts(language), {"width": 390, "height": 844}
    shown = re.compile(table["play.opened"])
    page = tab(log, shown=shown, locale=LOCALES[language], viewport=size)
    expect(page.locator("#play")).to_have_text(table["play.play"])
    is_good(page, language)


def test_a_studio_that_is_gone_leaves_the_drive_on_the_page(
    tmp_path: Path, tab: Callable[..., Page]
) -> None:
    """All of it is in the page: it needs no connection."""
    studio: Studio = Opened(str(recorded(tmp_path / "drive.log")), "--with", "forwarder.yaml")
    page = tab(studio)
    studio.stop()
    page.keyboard.press("End")
    assert at_s(page) > 15.0
