"""The pages as a site: built strictly, complete, and read in a real browser without a network."""

import re
import shutil
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote

import pytest

import canshaper
from canshaper.cli.app import Verbs
from tests.docs.pages import EVERY_PAGE
from tests.packaging.conftest import ROOT, SITE, built
from tests.studio.browser import NoBrowserError, browser

if TYPE_CHECKING:
    from playwright.sync_api import BrowserContext, Page

pytestmark = pytest.mark.processes

LOADED_BY_HREF = ("link", "image", "use")  # a link of <a> is only followed


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


@pytest.mark.slow
def test_every_page_of_the_repository_is_in_it(site: Path) -> None:
    pages = [*(ROOT / "docs").rglob("*.md"), ROOT / "CONTRIBUTING.md", ROOT / "SECURITY.md"]
    for page in pages:
        name = "index" if page.stem == "README" else page.stem
        assert (site / page.relative_to(ROOT)).with_name(f"{name}.html").exists(), page


@pytest.mark.slow
def test_the_reference_has_every_public_name_and_every_verb(site: Path) -> None:
    names = (site / "reference.html").read_text(encoding="utf-8")
    for name in canshaper.__all__:
        assert f'id="canshaper.{name}"' in names
    commands = (site / "commands.html").read_text(encoding="utf-8")
    for verb in Verbs(name="canshaper").list_commands(None):
        assert f'id="canshaper-{verb}"' in commands


class Parts(HTMLParser):
    """Addresses that a page loads when it is opened, and the scripts that may load more."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.scripts: set[str] = set()
        self._inline = False
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        of = {key: value or "" for key, value in attrs}
        loads = {"src", "srcset", "poster", "data"} | ({"href"} if tag in LOADED_BY_HREF else set())
        self.addresses += [of[key] for key in loads & of.keys()]
        self.addresses += re.findall(r"url\(([^)]*)", of.get("style", ""))
        if tag == "script" and "src" in of:
            self.scripts.add(Path(of["src"]).name)
        self._inline = tag == "script" and of.get("type") != "application/json"

    def handle_data(self, data: str) -> None:
        if self._inline and data.strip():
            self.scripts.add(re.sub(r"\.\./", "", data))


@pytest.mark.slow
def test_no_page_requests_anything_outside_of_it(offline: "BrowserContext") -> None:
    """All pages by what they name; of those with the same scripts, one in the browser."""
    pages = sorted(SITE.rglob("*.html"))
    assert len(pages) >= len(EVERY_PAGE) + len(("commands", "reference"))
    kinds: dict[frozenset[str], Path] = {}
    for page in pages:
        if page.name == "404.html":  # is for servers: its links begin at their root
            continue
        parts = Parts(page)
        assert any(address.endswith(".css") for address in parts.addresses)
        for address in parts.addresses:
            inside = (page.parent / unquote(address).partition("?")[0]).resolve()
            assert address.startswith("data:") or SITE in inside.parents, (page, address)
            assert address.startswith("data:") or inside.exists(), (page, address)
        kinds.setdefault(frozenset(parts.scripts), page)
    for sheet in SITE.rglob("*.css"):
        assert not re.search(r"(url\(|@import)\s*[\"']?(\w+:)?//", sheet.read_text()), sheet
    faults: list[str] = []
    for page in kinds.values():
        opened(offline, page, faults).close()
    assert faults == []


@pytest.mark.slow
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


@pytest.mark.slow
def test_broken_links_fail(tmp_path: Path) -> None:
    """In a tree of its own, of the repository's files but one page."""
    for name in ("CHANGELOG.md", "CONTRIBUTING.md", "LICENSE", "README.md", "canshaper", "config"):
        (tmp_path / name).symlink_to(ROOT / name)
    for name in ("docs", "examples", "studies"):
        (tmp_path / name).symlink_to(ROOT / name)
    shutil.copytree(ROOT / "tools" / "site", tmp_path / "tools" / "site")
    shutil.copy(ROOT / "mkdocs.yml", tmp_path)
    text = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    links = ("docs/no-such-page.md", "docs/guide.md#no-such-heading")
    text += "".join(f"\n[a link]({link})\n" for link in links)
    (tmp_path / "SECURITY.md").write_text(text, encoding="utf-8")
    done = built(tmp_path)
    assert done.returncode == 1
    for link in links:
        assert f"SECURITY.md' contains a link '{link}'" in done.stderr
    assert "Aborted with 2 warnings in strict mode" in done.stderr
