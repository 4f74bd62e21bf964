"""Requests of one page for the numbers of a running machine, checked, and their answers."""

import asyncio
from collections.abc import Callable, Mapping
from typing import Any

from canshaper.errors import CanshaperError, PageMessageError, printable
from canshaper.studio.cab import is_number
from canshaper.studio.numbers import LiveNumbers

MOST_WAITING = 10
MOST_NAME = 40

Action = Callable[[], Any]


class NumbersChannel:
    """One page's way to the numbers; the daemon's answers may take long, pictures go on meanwhile.

    Args:
        numbers: of the machine.
        page: number of the page, who names no one.
    """

    def __init__(self, numbers: LiveNumbers, page: int) -> None:
        self._numbers = numbers
        self._page = page
        self._waiting: asyncio.Queue[Action] = asyncio.Queue(MOST_WAITING)
        self._version = -1
        self._difference: dict[str, str] | None = None

    def receive(self, message: Mapping[str, Any]) -> None:
        """Take a message of the page.

        Raises:
            PageMessageError: it is none, or too many wait.
        """
        request, numbers = message["numbers"], self._numbers
        name = message.get("who")
        who = printable(name)[:MOST_NAME] if isinstance(name, str) and name else ""
        who = who or f"page {self._page}"
        actions: dict[object, Action] = {
            "undo": lambda: numbers.undo(who),
            "swap": lambda: numbers.swap(who),
            "difference": self._look_at_difference,
            "write": lambda: numbers.write(str(message.get("hash")), who),
        }
        if isinstance(request, dict):
            values, seen = _numbers(request.get("change")), _numbers(request.get("seen"))
            action: Action = lambda: numbers.change(values, seen, who)  # noqa: E731
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
        """Do what was asked for, one after the other.

        Args:
            refuse: called with why something was not done.
        """
        while True:
            action = await self._waiting.get()
            try:
                await asyncio.to_thread(action)
            except (CanshaperError, OSError) as error:
                refuse(str(error))

    def news(self) -> dict[str, Any]:
        """Return what the page was not shown yet."""
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
