"""Pages that do not behave: nonsense, too much, too fast, silent, a second driver."""

import json
import threading
from contextlib import ExitStack, suppress

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from canshaper.studio.client import MOST_BYTES, MOST_NONSENSE, MOST_PER_S
from canshaper.studio.server import MOST_PAGES
from tests.studio.conftest import Studio
from tests.studio.page import WAIT_S, Page
from tests.studio.shown import pose, valves

NONSENSE = [
    "",
    "x",
    "{",
    "[]",
    "null",
    "0.5",
    '"take"',
    "{}",
    '{"do": "go"}',
    '{"do": 1}',
    '{"do": ["take"]}',
    '{"joysticks": 1}',
    '{"joysticks": {"slew": 2}}',
    '{"joysticks": {"slew": NaN}}',
    '{"joysticks": {"slew": 1e999}}',
    '{"joysticks": {"slew": "1"}}',
    '{"joysticks": {"tower": 1}}',
    '{"antisway": 1}',
    '{"slide": "length", "to": "fast"}',
    '{"slide": "speed", "to": 1}',
    '{"slide": "length", "to": NaN}',
    '{"slide": "length", "to": 1' + "0" * 400 + "}",
    '{"joysticks": {"slew": 1' + "0" * 400 + "}}",
    '{"joysticks": {"\\ud800": 1}}',
    '{"do": "\\ud800"}',
    "日本" * 200,
    "[" * 1000,
    "\u0000",
]


def settled(page: Page) -> None:
    """Wait until no grapple swings: the tests share one machine."""
    page.until(lambda s: all((c["swing"] or 0.0) < 0.5 for c in s["cranes"].values()), "rest")


@pytest.mark.slow
@pytest.mark.parametrize("start", range(0, len(NONSENSE), MOST_NONSENSE - 5))
def test_nonsense_is_refused_with_a_word_and_nothing_moves(shared: Studio, start: int) -> None:
    with shared.page() as page:
        page.drive()
        settled(page)
        before = pose(page.shown)
        for text in NONSENSE[start : start + MOST_NONSENSE - 5]:
            page.refused.clear()
            page.connection.send(text)
            page.until(lambda _: bool(page.refused), "refusal")
            assert "expected " in page.refused[0], text
            assert valves(page.shown, "shaped") == valves(page.shown, "raw") == [0.0] * 3
        page.for_s(0.3)
        assert pose(page.shown) == before


@pytest.mark.slow
def test_bytes_are_nonsense(shared: Studio) -> None:
    with shared.page() as page:
        page.connection.send(b"\x00\xff" * 40)
        page.until(lambda _: "expected JSON, got bytes" in page.refused)


@pytest.mark.slow
def test_nonsense_of_the_driver_brings_its_joysticks_to_neutral(shared: Studio) -> None:
    with shared.page() as page:
        page.drive()
        assert page.joysticks is not None
        page.joysticks["lift"] = 0.5
        page.until(lambda s: valves(s, "shaped")[2] > 0.3)
        page.connection.send("nonsense")
        page.until(lambda s: s["cranes"]["shaped"]["axes"]["lift"]["joystick"] == 0.0)
        # The joystick is still held out, and counts for nothing; then enable goes.
        page.until(lambda s: not s["enable"], "enable released")
        assert valves(page.shown, "shaped")[2] == 0.0


@pytest.mark.slow
def test_too_much_nonsense_closes_the_page_and_the_others_go_on(shared: Studio) -> None:
    with shared.page() as page, shared.page() as other:
        for _ in range(MOST_NONSENSE):
            page.connection.send("日" * 40)  # the reason of the end is as long as one may be
        with pytest.raises(ConnectionClosed) as closed:
            page.until(lambda _: False)
        assert closed.value.rcvd and closed.value.rcvd.code == 1008
        assert "no messages" in closed.value.rcvd.reason
        other.until(lambda _: any("is closed" in text for text in other.texts()))


@pytest.mark.slow
def test_a_page_that_sends_too_fast_is_closed_and_its_joysticks_go_to_neutral(
    shared: Studio,
) -> None:
    with shared.page() as page, shared.page() as other:
        page.drive()
        message = json.dumps({"joysticks": {"slew": 0.0, "near_far": 0.0, "lift": 0.5}})

        def flood() -> None:
            with suppress(ConnectionClosed, OSError):
                while True:
                    page.connection.send(message)

        flooding = threading.Thread(target=flood)
        flooding.start()
        page.joysticks = None
        with pytest.raises(ConnectionClosed) as closed:
            page.until(lambda _: False)
        flooding.join(WAIT_S)
        assert not flooding.is_alive()
        assert closed.value.rcvd and closed.value.rcvd.code == 1008
        assert f"expected {MOST_PER_S} messages a second at most" in closed.value.rcvd.reason
        other.now()
        other.until(lambda s: s["cranes"]["shaped"]["axes"]["lift"]["joystick"] == 0.0)
        other.until(lambda s: not s["enable"])
        assert all(crane["daemon"] for crane in other.shown["cranes"].values())


@pytest.mark.slow
def test_a_huge_message_closes_the_page(shared: Studio) -> None:
    with shared.page() as page:
        page.connection.send("x" * (MOST_BYTES + 1))
        with pytest.raises(ConnectionClosed) as closed:
            page.until(lambda _: False)
        assert closed.value.rcvd and closed.value.rcvd.code == 1009


@pytest.mark.slow
def test_pages_beyond_the_most_are_refused_with_the_reason(shared: Studio) -> None:
    with ExitStack() as stack:
        for _ in range(MOST_PAGES):
            stack.enter_context(shared.page())
        late = stack.enter_context(
            connect(f"ws://{shared.host}/ws", origin=f"http://{shared.host}")
        )
        with pytest.raises(ConnectionClosed) as closed:
            late.recv(timeout=WAIT_S)
        assert closed.value.rcvd and "pages are open already" in closed.value.rcvd.reason
    with shared.page() as page:
        assert page.look()
