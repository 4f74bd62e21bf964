"""The pictures of docs/studio.md and the film of README, from the real page after real drives.

python -m tests.studio.pictures docs
"""

import argparse
import base64
import io
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import Browser, expect

from tests.studio.browser import NoBrowserError, browser, opened
from tests.studio.conftest import Studio

SIZE = {"width": 1440, "height": 900}
FILM_SIZE = {"width": 1100, "height": 720}
FILM_MS, FILM_WIDTH = 100, 640  # between two pictures of the film; its width, pixels


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


def film(one: Browser, studio: Studio, path: Path) -> None:
    """Slew for two seconds, let go, and watch both grapples for six."""
    faults: list[str] = []
    page = opened(one, studio.url, faults, viewport=FILM_SIZE, color_scheme="light")
    page.keyboard.press("e")
    expect(page.locator("#axes .state[data-level=ready]")).to_have_count(6)
    box = page.locator("#stage").bounding_box()
    assert box
    shots: list[tuple[float, bytes]] = []
    session = page.context.new_cdp_session(page)

    def on_picture(shown: dict[str, Any]) -> None:
        shots.append((shown["metadata"]["timestamp"], base64.b64decode(shown["data"])))
        session.send("Page.screencastFrameAck", {"sessionId": shown["sessionId"]})

    session.on("Page.screencastFrame", on_picture)
    session.send("Page.startScreencast", {"format": "jpeg", "quality": 90, "everyNthFrame": 1})
    page.keyboard.down("d")
    page.wait_for_timeout(2000)
    page.keyboard.up("d")
    page.wait_for_timeout(6000)
    session.send("Page.stopScreencast")
    page.context.close()
    corner = (box["x"], box["y"], box["x"] + box["width"], box["y"] + box["height"])
    pictures, due = [], shots[0][0]
    for stamp, data in shots:
        if stamp >= due:
            picture = Image.open(io.BytesIO(data)).convert("RGB").crop(corner)
            pictures.append(
                picture.resize((FILM_WIDTH, round(FILM_WIDTH * picture.height / picture.width)))
            )
            due += FILM_MS / 1000.0
    pictures[0].save(
        path, save_all=True, append_images=pictures[1:], duration=FILM_MS, loop=0, quality=60
    )
    print(path, f"{len(pictures)} pictures", *faults, sep="\n  ")


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
            studio = Studio(file="forwarder-robust.yaml")
            try:
                film(one, studio, directory / "drive.webp")
            finally:
                studio.stop()
    except NoBrowserError as error:
        raise SystemExit(f"no pictures: {error}") from None


if __name__ == "__main__":
    main()
