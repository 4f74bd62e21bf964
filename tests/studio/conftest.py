"""A studio as a user starts it."""

import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from websockets.sync.client import connect

from canshaper.bus.port import Port, open_port
from canshaper.codec.frame import Frame
from canshaper.config.schema import Bus
from tests.studio.page import WAIT_S, Page

if TYPE_CHECKING:
    from playwright.sync_api import Browser
    from playwright.sync_api import Page as Tab

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
    def page(self, **options: Any) -> Iterator[Page]:
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
        """Frames since the last look."""
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
