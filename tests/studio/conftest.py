"""A studio as a user starts it, and a page without a browser."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from websockets.sync.client import ClientConnection, connect

from canshaper.bus.port import Port, open_port
from canshaper.codec.frame import Frame
from canshaper.config.schema import Bus

if TYPE_CHECKING:
    from playwright.sync_api import Browser
    from playwright.sync_api import Page as Tab

# Only to end a test that hangs.
WAIT_S = 60.0
# Drives that a busy machine may hold up, and what the page says of that.
TRIES = 8
DISTURBED = re.compile(
    "is silent|no joystick message|joystick messages are not|too late|stood still"
)
HERE = Path(__file__).parent
ROOT = HERE.parents[1]


def free_groups() -> tuple[str, str]:
    """Two multicast groups that no other test of this machine uses: named after a free port."""
    with socket.create_server(("127.0.0.1", 0)) as one:
        port = one.getsockname()[1]
    return f"239.250.{port // 256}.{port % 256}", f"239.251.{port // 256}.{port % 256}"


@pytest.hookimpl(tryfirst=True)  # before marks select
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    skip = pytest.mark.skip(reason="needs a browser: run make test-browser-all")
    for item in items:
        # This hook sees the items of all directories.
        if item.path.parent == HERE and item.path.name.startswith("test_browser"):
            item.add_marker(pytest.mark.slow)  # those of make test: tests/budget.py
            if "CANSHAPER_BROWSER" not in os.environ:
                item.add_marker(skip)


class Studio:
    """``canshaper studio`` as a process; with no groups its cranes are in that process."""

    def __init__(
        self, *options: str, file: str = "forwarder.yaml", groups: tuple[str, ...] | None = None
    ) -> None:
        self.groups = free_groups() if groups is None else groups
        self._command = [sys.executable, "-m", "canshaper", "studio", file, "--port", "0", *options]
        if self.groups:
            self._command += ["--interface", "udp_multicast"]
        shown = self.groups[:1] if "--shadow" in options else self.groups
        self._command += [word for group in shown for word in ("--channel", group)]
        self.start()

    def start(self, port: int = 0) -> None:
        """Start it, at a port."""
        at = self._command.index("--port") + 1
        command = [*self._command[:at], str(port), *self._command[at + 1 :]]
        self.process = subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        assert self.process.stdout
        self.first_line = self.process.stdout.readline()
        opened = re.search(r"open (http://([^/]+):(\d+)/\S*)", self.first_line)
        assert opened, self.first_line + self.process.stdout.read()
        self.url, self.port = opened[1], int(opened[3])
        self.host = f"127.0.0.1:{self.port}"

    def children(self, verb: str | None = None) -> list[int]:
        """Its processes, those that run a verb."""
        path = f"/proc/{self.process.pid}/task"
        children = []
        for task in Path(path).iterdir():
            with suppress(FileNotFoundError):  # a thread that has just ended
                children += [int(pid) for pid in (task / "children").read_text().split()]
        return sorted(pid for pid in children if verb is None or verb in command_of(pid))

    @contextmanager
    def page(self, **options: Any) -> Iterator["Page"]:
        """A page that is connected."""
        options = {"origin": f"http://{self.host}", "open_timeout": WAIT_S, **options}
        if token := self.url.partition("token=")[2]:
            cookie = f"canshaper-studio-{self.port}={token}"
            options.setdefault("additional_headers", {"Cookie": cookie})
        options["max_queue"] = None  # a page that is not looked at can still be closed
        with connect(f"ws://{self.host}/ws", **options) as connection:
            yield Page(connection)

    def stop(self) -> str:
        """End it as a service manager does; what it printed. It has to end well."""
        children = self.children()
        self.process.send_signal(signal.SIGTERM)
        out, _ = self.process.communicate(timeout=WAIT_S)
        assert self.process.returncode == 0, out
        assert not any(Path(f"/proc/{pid}").exists() for pid in children)
        return str(out)


class Opened(Studio):
    """``canshaper studio`` of drives that are over, as a process."""

    def __init__(self, *arguments: str) -> None:
        self._command = [sys.executable, "-m", "canshaper", "studio", "--port", "0", *arguments]
        self.start()


def command_of(pid: int) -> list[str]:
    """Words of a process' command line; none where it has gone."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_text().split("\0")
    except OSError:
        return []


class Page:
    """What a page does, without a browser."""

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
        """What is to be seen now; a page that was not looked at for a while has old pictures."""
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
        self.until(lambda s: self.states() == {"ready"}, "axes ready")

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
        """What happened."""
        return [event[3] for event in self.events]


@pytest.fixture(scope="module")
def shared() -> Iterator[Studio]:
    """One studio for the tests of a module that leave it as it was."""
    studio = Studio()
    try:
        yield studio
    finally:
        studio.stop()


@pytest.fixture
def own() -> Iterator[Callable[..., Studio]]:
    """Starts studios for one test."""
    started: list[Studio] = []

    def start(*options: str, **more: Any) -> Studio:
        started.append(Studio(*options, **more))
        return started[-1]

    try:
        yield start
    finally:
        for studio in started:
            if studio.process.poll() is None:
                studio.stop()


class Listener:
    """Somebody else on a bus: every frame there."""

    def __init__(self, group: str) -> None:
        bus = Bus(interface="udp_multicast", channel=group)
        self.port: Port = open_port("crane", bus, lambda _: None)

    def frames(self) -> list[Frame]:
        """What has come since the last look."""
        frames: list[Frame] = []
        while some := list(self.port.frames()):
            frames += some
        return frames


@pytest.fixture
def listen() -> Iterator[Callable[[str], Listener]]:
    """Opens listeners."""
    opened: list[Listener] = []

    def open_one(group: str) -> Listener:
        opened.append(Listener(group))
        return opened[-1]

    yield open_one
    for one in opened:
        one.port.close()


@pytest.fixture(scope="session")
def chromium() -> Iterator["Browser"]:
    """A browser; without one the tests are skipped."""
    from tests.studio.browser import NoBrowserError, browser

    try:
        with browser() as one:
            yield one
    except NoBrowserError as error:
        pytest.skip(f"no browser: {error}")


@pytest.fixture
def tab(chromium: "Browser") -> Iterator[Callable[..., "Tab"]]:
    """Opens tabs; at the end nothing may have gone wrong in any of them."""
    from tests.studio.browser import opened

    faults: list[str] = []
    tabs: list[Tab] = []

    def open_one(studio: Studio, **options: Any) -> "Tab":
        tabs.append(opened(chromium, studio.url, faults, **options))
        return tabs[-1]

    yield open_one
    for one in tabs:
        one.context.close()
    assert faults == []
