"""The pictures of docs/studio.md, taken from the real page after a real drive.

python -m tests.studio.pictures docs
"""

import argparse
from pathlib import Path

from playwright.sync_api import Browser, expect

from tests.studio.browser import NoBrowserError, browser, opened
from tests.studio.conftest import Studio

SIZE = {"width": 1440, "height": 900}


def take(one: Browser, studio: Studio, scheme: str, path: Path, *, overlay: bool) -> None:
    """Slew to the left for a second, and take the picture while the raw grapple swings."""
    faults: list[str] = []
    page = opened(one, studio.url, faults, viewport=SIZE, color_scheme=scheme)
    expect(page.locator("#seat")).to_have_text("you drive: press enable")
    page.keyboard.press("e")
    expect(page.locator("#axes .state[data-level=ready]")).to_have_count(6)
    if overlay:
        page.keyboard.press("v")
    out, back = ("a", "d") if overlay else ("d", "a")
    for key in (out, back):
        page.keyboard.down(key)
        page.wait_for_timeout(700)
        page.keyboard.up(key)
        page.wait_for_timeout(2600)
    page.keyboard.down(back)
    page.wait_for_timeout(600)
    page.keyboard.up(back)
    page.wait_for_timeout(1150)
    page.screenshot(path=path)
    page.context.close()
    print(path, *faults, sep="\n  ")


def main() -> None:
    """Take them."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("directory", type=Path)
    directory = parser.parse_args().directory
    try:
        with browser() as one:
            for scheme, overlay in (("dark", False), ("light", True)):
                studio = Studio()
                path = directory / f"studio-{scheme}.png"
                try:
                    take(one, studio, scheme, path, overlay=overlay)
                finally:
                    studio.stop()
    except NoBrowserError as error:
        raise SystemExit(f"no pictures: {error}") from None


if __name__ == "__main__":
    main()
