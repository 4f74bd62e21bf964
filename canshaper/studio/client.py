"""One open page: check its messages, and send it the state thirty times a second."""

import asyncio
import json
import time
from collections.abc import Callable, Mapping
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from canshaper.errors import CanshaperError, PageMessageError, printable
from canshaper.studio.cab import Cab, is_number
from canshaper.studio.numbers import LiveNumbers
from canshaper.studio.preference import Preference
from canshaper.studio.stage import Stage
from canshaper.studio.words import said

MOST_WAITING = 10
MOST_NAME = 40


class NumbersChannel:
    """Queue of one page's requests to change numbers; a slow daemon does not hold pictures up.

    Args:
        numbers: the adjustable numbers of the machine's daemon.
        page: number of the page, its name in changes if the person gives none.
    """

    def __init__(self, numbers: LiveNumbers, page: int) -> None:
        self._numbers = numbers
        self._page = page
        self._waiting: asyncio.Queue[Callable[[], Any]] = asyncio.Queue(MOST_WAITING)
        self._version = -1
        self._difference: dict[str, str] | None = None

    def receive(self, message: Mapping[str, Any]) -> None:
        """Queue a message's request: ``numbers`` is a change, undo, swap, difference or write.

        Raises:
            PageMessageError: the message is no request, or too many requests wait.
        """
        request, numbers = message["numbers"], self._numbers
        name = message.get("who")
        who = printable(name)[:MOST_NAME] if isinstance(name, str) and name else ""
        who = who or f"page {self._page}"
        actions: dict[object, Callable[[], Any]] = {
            "undo": lambda: numbers.undo(who),
            "swap": lambda: numbers.swap(who),
            "difference": self._look_at_difference,
            "write": lambda: numbers.write(str(message.get("hash")), who),
        }
        if isinstance(request, dict):
            values, seen = _numbers(request.get("change")), _numbers(request.get("seen"))
            action: Callable[[], Any] = lambda: numbers.change(values, seen, who)  # noqa: E731
        elif isinstance(request, str) and request in actions:
            action = actions[request]
        else:
            raise PageMessageError(
                f"numbers: expected a change or one of {', '.join(map(str, actions))}"
            )
        try:
            self._waiting.put_nowait(action)
        except asyncio.QueueFull:
            raise PageMessageError("numbers: too many changes wait for the daemon") from None

    def _look_at_difference(self) -> None:
        self._difference = self._numbers.difference()

    async def run(self, refuse: Callable[[str], None]) -> None:
        """Do requests one after the other, until cancelled; call ``refuse`` with why one failed."""
        while True:
            action = await self._waiting.get()
            try:
                await asyncio.to_thread(action)
            except (CanshaperError, OSError) as error:
                refuse(str(error))

    def news(self) -> dict[str, Any]:
        """Return what is new for the page since the last call: ``numbers``, ``difference``."""
        news: dict[str, Any] = {}
        if self._version != self._numbers.version:
            self._version = self._numbers.version
            news["numbers"] = self._numbers.shown()
        if self._difference is not None:
            news["difference"], self._difference = self._difference, None
        return news


def _numbers(values: object) -> dict[str, float]:
    if not isinstance(values, dict) or not all(is_number(one) for one in values.values()):
        raise PageMessageError("numbers: expected numbers by their keys, got something else")
    return {str(key): float(one) for key, one in values.items()}


SHOW_S = 1.0 / 30.0
MOST_PER_S = 120
"""Mean messages a second that a page may send; the positions of its joysticks are 50."""
BURST = 240
"""Messages that a page may send at once, as after a stall."""
MOST_NONSENSE = 20
"""Refused messages after which a page is closed."""
MOST_BYTES = 2048
"""Bytes of one message; joysticks take less than 200."""

# RFC 6455, 5.5.1 and 7.4.1
MOST_REASON = 123
POLICY_VIOLATION = 1008
TRY_AGAIN_LATER = 1013

Action = Callable[[Cab, float], None]


class Client:
    """A page on its connection.

    Args:
        socket: the connection, accepted.
        stage: the cranes that the page drives and watches.
        number: unique number of the page.
        hello: the first message to the page.
    """

    def __init__(self, socket: WebSocket, stage: Stage, number: int, hello: dict[str, Any]) -> None:
        self._socket = socket
        self._stage = stage
        self._number = number
        self._hello = hello
        self._refusals: list[str] = []
        self._nonsense = 0
        self._closed = False
        self._allowance = float(BURST)
        self._filled_s = time.monotonic()
        self._pending: dict[str, float] = {}
        self._slid = asyncio.Event()
        self._preference: Preference | None = None  # its settings are still to be sent
        self._numbers = NumbersChannel(stage.numbers, number) if stage.numbers else None

    async def serve(self) -> None:
        """Serve the page until it is gone or closed; then free the driver's seat."""
        work = [self._receive(), self._show(), self._slide()]
        if self._numbers:
            work.append(self._numbers.run(self._refusals.append))
        tasks = [asyncio.create_task(one) for one in work]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            ends = await asyncio.gather(*tasks, return_exceptions=True)
            self._stage.with_cab(lambda cab, now_s: cab.leave(self._number, now_s))
        for end in ends:
            # Sending fails once the page has gone, or was closed; all else is a fault of ours.
            usual = isinstance(end, asyncio.CancelledError | WebSocketDisconnect)
            if isinstance(end, BaseException) and not usual and not self._closed:
                raise end

    # -- from the page -------------------------------------------------------------------------

    async def _receive(self) -> None:
        while True:
            message = await self._socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            if why := self._too_fast():
                await self._close(why)
                return
            try:
                self._take(message.get("text"))
            except PageMessageError as error:
                self._stage.with_cab(lambda cab, now_s: cab.nonsense(self._number, now_s))
                self._refusals.append(str(error))
                self._nonsense += 1
                if self._nonsense >= MOST_NONSENSE:
                    await self._close(f"{MOST_NONSENSE} messages were no messages; last: {error}")
                    return

    def _too_fast(self) -> str | None:
        """Count a message; return why the page is closed for too many, or None."""
        now_s = time.monotonic()
        self._allowance = min(BURST, self._allowance + MOST_PER_S * (now_s - self._filled_s))
        self._filled_s = now_s
        self._allowance -= 1.0
        return f"expected {MOST_PER_S} messages a second at most" if self._allowance < 0 else None

    def _take(self, text: str | None) -> None:
        """Execute a message; numbers, settings and sliders go on in other tasks.

        Raises:
            PageMessageError: the message is not a known one, or has a wrong value.
        """
        message = parsed(text)
        number = self._number
        if (joysticks := message.get("joysticks")) is not None:
            if not isinstance(joysticks, dict):
                raise PageMessageError("joysticks: expected an object, got another value")
            self._stage.with_cab(lambda cab, now_s: cab.joysticks(number, joysticks, now_s))
        elif (word := message.get("do")) is not None:
            self._stage.with_cab(_action(word, number))
        elif isinstance(on := message.get("antisway"), bool):
            self._stage.with_cab(lambda cab, _: cab.switch_anti_sway(number, on))
        elif "numbers" in message and self._numbers:
            self._numbers.receive(message)
        elif "settings" in message:
            self._preference = self._stage.preference
        elif not self._stage.other(number, message):
            name, factor = message.get("slide"), message.get("to")
            known = isinstance(name, str) and name in self._stage.positions
            if not known or not is_number(factor):
                raise PageMessageError("expected a message that is known, got another")
            self._pending[str(name)] = factor
            self._slid.set()

    async def _slide(self) -> None:
        """Pass the last position of each slider on; refuse it if the page does not drive."""
        while True:
            await self._slid.wait()
            self._slid.clear()
            while self._pending:
                name = next(iter(self._pending))
                factor = self._pending.pop(name)
                if self._stage.snapshot()["driver"] != self._number:
                    self._refusals.append(said("sliders"))
                    continue
                try:
                    await asyncio.to_thread(self._stage.slide, name, factor)
                except (ValueError, CanshaperError) as error:
                    self._refusals.append(str(error))

    # -- to the page ---------------------------------------------------------------------------

    async def _show(self) -> None:
        """Send the present state; a slow page gets fewer pictures, never old ones."""
        await self._send({"hello": {**self._hello, "page": self._number}})
        last = 0
        while True:
            shown = self._stage.snapshot()
            events = self._stage.events.since(last)
            if events:
                last = events[-1].number
                shown["events"] = [list(event) for event in events]
            if self._preference and (found := self._preference.ready()) is not None:
                shown["settings"], self._preference = found, None
            if self._numbers:
                shown |= self._numbers.news()
            if self._refusals:
                shown["refused"] = self._refusals[-5:]
                self._refusals.clear()
            await self._send(shown)
            await asyncio.sleep(SHOW_S)

    async def _send(self, what: dict[str, Any]) -> None:
        await self._socket.send_text(json.dumps(what, separators=(",", ":")))

    async def _close(self, why: str) -> None:
        self._stage.events.add("page", said("closed", page=self._number, why=why), "warn")
        self._stage.with_cab(lambda cab, now_s: cab.nonsense(self._number, now_s))
        self._closed = True
        reason = why.encode()[:MOST_REASON].decode(errors="ignore")
        await self._socket.close(POLICY_VIOLATION, reason)


def parsed(text: str | None) -> dict[str, Any]:
    """Return a JSON message of a page as a dict.

    Raises:
        PageMessageError: the text is no JSON object.
    """
    if text is None:
        raise PageMessageError("expected JSON, got bytes")
    try:
        message = json.loads(text)
    except (ValueError, RecursionError):
        raise PageMessageError(f"expected JSON, got {text[:40]!r}") from None
    if not isinstance(message, dict):
        raise PageMessageError(f"expected an object, got {text[:40]!r}")
    return message


def _action(word: object, number: int) -> Action:
    actions: dict[object, Action] = {
        "take": lambda cab, now_s: cab.take(number, now_s),
        "leave": lambda cab, now_s: cab.leave(number, now_s),
        "enable": lambda cab, now_s: cab.press_enable(number, True, now_s),
        "release": lambda cab, now_s: cab.press_enable(number, False, now_s),
        "reset": lambda cab, now_s: cab.press_reset(number, now_s),
        "profile": lambda cab, now_s: cab.press_next_profile(number, now_s),
    }
    if not isinstance(word, str) or word not in actions:
        raise PageMessageError(
            f"expected one of {', '.join(map(str, actions))}, got {str(word)[:20]!r}"
        )
    return actions[word]
