"""The pages as a site: built strictly, complete, and read in a real browser without a network."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import canshaper
from canshaper.cli.app import Verbs
from tests.packaging.conftest import ROOT, SITE, built
from tests.studio.browser import NoBrowserError, browser

if TYPE_CHECKING:
    from playwright.sync_api import BrowserContext, Page

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def offline(site: Path) -> "Iterator[BrowserContext]":
    """A browser that reaches no network."""
    try:
        with browser() as one:
            context = one.new_context(offline=True)
            yield context
            context.close()
    except NoBrowserError as error:
        pytest.skip(f"no browser: {error}")


def opened(context: "BrowserContext", page: Path, faults: list[str]) -> "Page":
    tab = context.new_page()
    tab.on("console", lambda m: faults.append(m.text) if m.type in ("error", "warning") else None)
    tab.on("pageerror", lambda error: faults.append(str(error)))
    tab.on("requestfailed", lambda request: faults.append(f"failed: {request.url}"))

    def inside(request: object) -> None:
        url = str(getattr(request, "url", ""))
        if not url.startswith((SITE.as_uri(), "data:", "blob:")):
            faults.append(f"asks for {url}")

    tab.on("request", inside)
    tab.goto(page.as_uri())
    return tab


def test_every_page_of_the_repository_is_in_it(site: Path) -> None:
    pages = [*(ROOT / "docs").rglob("*.md"), ROOT / "CONTRIBUTING.md", ROOT / "SECURITY.md"]
    for page in pages:
        name = "index" if page.stem == "README" else page.stem
        assert (site / page.relative_to(ROOT)).with_name(f"{name}.html").exists(), page


def test_the_reference_has_every_public_name_and_every_verb(site: Path) -> None:
    names = (site / "reference.html").read_text(encoding="utf-8")
    for name in canshaper.__all__:
        assert f'id="canshaper.{name}"' in names
    commands = (site / "commands.html").read_text(encoding="utf-8")
    for verb in Verbs(name="canshaper").list_commands(None):
        assert f'id="canshaper-{verb}"' in commands


def test_no_page_requests_anything_outside_of_it(offline: "BrowserContext") -> None:
    faults: list[str] = []
    pages = sorted(SITE.rglob("*.html"))
    assert len(pages) > 40
    for page in pages:
        if page.name != "404.html":  # is for servers: its links begin at their root
            opened(offline, page, faults).close()
    assert faults == []


def test_search_and_diagram_work_in_files(offline: "BrowserContext") -> None:
    faults: list[str] = []
    tab = opened(offline, SITE / "index.html", faults)
    tab.locator(".md-search__input").first.click()
    tab.keyboard.type("stopping distance")
    hit = tab.locator(".md-search-result__item a").first
    hit.wait_for()
    hit.click()
    tab.wait_for_url("**/docs/*.html*")
    states = opened(offline, SITE / "docs" / "states.html", faults)
    box = states.locator(".drawn svg").bounding_box()
    assert box is not None
    assert box["width"] > 400
    assert faults == []


@pytest.mark.parametrize("link", ["docs/no-such-page.md", "docs/guide.md#no-such-heading"])
def test_a_broken_link_fails(link: str, tmp_path: Path) -> None:
    """In a tree of its own, of the repository's files but one page."""
    for name in ("CHANGELOG.md", "CONTRIBUTING.md", "LICENSE", "README.md", "canshaper", "config"):
        (tmp_path / name).symlink_to(ROOT / name)
    for name in ("docs", "examples", "studies"):
        (tmp_path / name).symlink_to(ROOT / name)
    shutil.copytree(ROOT / "tools" / "site", tmp_path / "tools" / "site")
    shutil.copy(ROOT / "mkdocs.yml", tmp_path)
    text = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    (tmp_path / "SECURITY.md").write_text(f"{text}\n[a link]({link})\n", encoding="utf-8")
    done = built(tmp_path)
    assert done.returncode == 1
    assert "SECURITY.md' contains a link" in done.stderr
    assert "Aborted with 1 warnings in strict mode" in done.stderr
