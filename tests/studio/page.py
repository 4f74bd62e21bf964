"""A page without a browser: what it sees, and what it does."""

import json
import re
import time
from collections.abc import Callable
from typing import Any

import pytest
from websockets.sync.client import ClientConnection

# Only to end a test that hangs.
WAIT_S = 60.0
# Drives that a busy machine may hold up, and what the page says of that.
TRIES = 8
DISTURBED = re.compile(
    "is silent|no joystick message|joystick messages are not|too late|stood still"
)
LATE = re.compile("the daemon is too late|the daemon stood still")


class Page:
    """A page without a browser."""

    def __init__(self, connection: ClientConnection) -> None:
        self.connection = connection
        self.events: list[list[Any]] = []
        self.refused: list[str] = []
        self.joysticks: dict[str, float] | None = None
        hello = json.loads(connection.recv(timeout=WAIT_S))["hello"]
        self.hello: dict[str, Any] = hello
        self.shown = self.look()

    def send(self, **message: Any) -> None:
        """Send one message."""
        self.connection.send(json.dumps(message))

    def look(self) -> dict[str, Any]:
        """The next picture; a hand that holds the joysticks goes on holding them."""
        self.shown = json.loads(self.connection.recv(timeout=WAIT_S))
        self.events += self.shown.get("events", [])
        self.refused += self.shown.get("refused", [])
        if self.joysticks is not None:
            self.send(joysticks=self.joysticks)
        return self.shown

    def until(self, condition: Callable[[dict[str, Any]], bool], what: str = "") -> dict[str, Any]:
        """Look until something is so."""
        limit = time.monotonic() + WAIT_S
        while not condition(self.look()):
            assert time.monotonic() < limit, f"{what} not within {WAIT_S} s: {self.shown}"
        return self.shown

    def now(self) -> dict[str, Any]:
        """Return the newest picture; a page that was not looked at for a while has old ones."""
        now_s = time.monotonic()  # the studio's clock, too
        return self.until(lambda s: s["t"] >= now_s, "now")

    def for_s(self, duration_s: float) -> list[dict[str, Any]]:
        """Every picture of so long, by the clock of the studio."""
        end = self.shown["t"] + duration_s
        pictures = []
        while self.shown["t"] < end:
            pictures.append(self.look())
        return pictures

    def drive(self) -> None:
        """Take the joysticks and press enable, with the axes ready."""
        self.until(lambda s: all(c["daemon"] and c["crane"] for c in s["cranes"].values()))
        self.send(do="take")
        self.joysticks = dict.fromkeys(self.hello["axes"], 0.0)
        self.until(lambda s: s["driver"] == self.hello["page"], "driver")
        self.until(lambda s: not s["enable"], "enable released by the last one")
        self.send(do="enable")
        limit = time.monotonic() + WAIT_S
        while self.states() != {"ready"}:
            self.look()
            if time.monotonic() > limit:
                axes = [a for c in self.shown["cranes"].values() for a in c["axes"].values()]
                if any(LATE.search(axis["reason"] or "") for axis in axes):
                    pytest.skip(f"the machine was too busy for {WAIT_S} s: daemons were late")
                pytest.fail(f"axes ready not within {WAIT_S} s: {self.shown}")

    def hold(
        self, level: float, condition: Callable[[dict[str, Any]], bool], what: str = ""
    ) -> dict[str, Any]:
        """Hold all joysticks out until something is so.

        On a busy machine a page is silent for longer than it may be, and enable goes: then again.
        """

        def held(_shown: dict[str, Any]) -> bool:
            if self.shown["driver"] != self.hello["page"] or not self.shown["enable"]:
                self.drive()
            self.joysticks = dict.fromkeys(self.hello["axes"], level)
            return condition(self.shown)

        return self.until(held, what)

    def stroke(self, part: float, duration_s: float) -> dict[str, float]:
        """Slew so long and let go; the swing that is left of each crane, in degrees.

        Where a busy machine held up page or joysticks meanwhile, once more.
        """
        for _ in range(TRIES):
            before = len(self.events)
            if self.joysticks is None or not self.shown["enable"]:
                self.drive()
            self.joysticks = {**dict.fromkeys(self.hello["axes"], 0.0), "slew": part}
            self.until(
                lambda s: (
                    all(c["axes"]["slew"]["valve"] for c in s["cranes"].values()) or not s["enable"]
                )
            )
            self.for_s(duration_s)
            self.joysticks["slew"] = 0.0
            self.until(lambda s: self.states() == {"ready"} or not s["enable"], "at rest")
            swings = {name: one["swing"] for name, one in self.for_s(3.0)[-1]["cranes"].items()}
            if not any(DISTURBED.search(event[3]) for event in self.events[before:]):
                return swings
        pytest.skip(f"the machine was too busy in each of {TRIES} drives")

    def states(self) -> set[str]:
        """Levels of all axes; one without a status message has none."""
        axes = [axis for c in self.shown["cranes"].values() for axis in c["axes"].values()]
        return {axis["level"] for axis in axes if axis["state"]}

    def texts(self) -> list[str]:
        """Texts of the events."""
        return [event[3] for event in self.events]
