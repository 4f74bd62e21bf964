"""The page in a browser with the shipped deployments of other protocols behind it."""

from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.studio.browser import SOON_MS, state, swing, undisturbed
from tests.studio.conftest import Studio

SHIPPED = (
    "cia402-forwarder",
    "js6000-forwarder",
    "moog-forwarder",
    "pvedcc-forwarder",
)


@pytest.mark.parametrize("name", SHIPPED)
def test_keys_drive_each_axis_in_its_closed_loop(
    own: Callable[..., Studio], tab: Callable[..., Page], name: str
) -> None:
    page = tab(own(file=f"config/{name}.yaml", groups=()))

    def drive() -> None:
        for axis, key in (("lift", "ArrowUp"), ("near-far", "w"), ("slew", "a")):
            page.keyboard.down(key)
            expect(state(page, 1, axis)).to_have_text("moving, shaped", timeout=SOON_MS)
            page.wait_for_timeout(900)
            page.keyboard.up(key)
            expect(page.locator("#axes .state[data-level=ready]")).to_have_count(6)
        page.wait_for_timeout(3000)
        raw, shaped = swing(page, "raw"), swing(page, "shaped")
        assert raw > 8.0
        assert shaped < raw / 2

    undisturbed(page, drive)
