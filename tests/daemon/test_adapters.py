"""Daemons as processes on adapters of python-can: one that takes nothing, one bus for two."""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import can
import pytest
import yaml

from canshaper.bus.multicast import LocalMulticastBus
from canshaper.machine.binding import load_deployment
from tests.bus.lines import ANSWER_S, SerialLine
from tests.rigs.files import text_of

pytestmark = pytest.mark.processes

GROUP = f"239.78.{os.getpid() // 256 % 256}.{os.getpid() % 256}"
MULTICAST = {"interface": "udp_multicast", "channel": GROUP}


def written(path: Path, change: Callable[[dict], None]) -> Path:  # type: ignore[type-arg]
    """The shipped forwarder, changed."""
    content = yaml.safe_load(text_of("forwarder"))
    content["buses"] = {"crane": MULTICAST}
    change(content)
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


@contextmanager
def running(file: Path) -> Iterator[tuple[subprocess.Popen[bytes], Callable[[str], None]]]:
    """A daemon that has started, and a call that waits for a line of its log."""
    log = file.with_suffix(".log")
    with log.open("wb") as errors:
        command = [sys.executable, "-m", "canshaper", "run", str(file)]
        process = subprocess.Popen(command, stderr=errors)

    def logged(pattern: str) -> None:
        end = time.monotonic() + ANSWER_S
        while not re.search(pattern, log.read_text()):
            assert time.monotonic() < end, log.read_text()
            assert process.poll() is None, log.read_text()
            time.sleep(0.01)

    try:
        logged("started file=")
        yield process, logged
    finally:
        process.kill()
        process.wait()


def ids_of(file: Path) -> dict[str, int]:
    """Ids of the valve frames by axis."""
    axes = load_deployment(file).axes.items()
    return {name: axis.valve.message.key[1] for name, axis in axes if axis.valve.message}


def received(bus: can.BusABC, expected: set[int]) -> None:
    """Wait until a frame of each id came."""
    end = time.monotonic() + ANSWER_S
    left = set(expected)
    while left:
        assert time.monotonic() < end, left
        if message := bus.recv(1.0):
            left.discard(message.arbitration_id)


def test_an_adapter_that_takes_nothing_holds_neither_the_other_bus_nor_the_end(
    tmp_path: Path,
) -> None:
    line = SerialLine()

    def slewed_by_slcan(content: dict) -> None:  # type: ignore[type-arg]
        options = {"sleep_after_open": 0.0}
        content["buses"]["tool"] = {"interface": "slcan", "channel": line.path, "options": options}
        content["axes"]["slew"]["valve"]["bus"] = "tool"

    file = written(tmp_path / "machine.yaml", slewed_by_slcan)
    ids = ids_of(file)
    done = threading.Event()

    def fill() -> None:
        theirs = os.open(line.path, os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
        while not done.is_set():
            with suppress(BlockingIOError):
                os.write(theirs, b"\r" * 1024)
                continue
            time.sleep(0.001)
        os.close(theirs)

    with LocalMulticastBus(GROUP) as bus, running(file) as (process, logged):
        other = threading.Thread(target=fill)
        other.start()
        try:
            logged("bus=tool state=not-confirmed")
            while bus.recv(0):
                pass
            received(bus, {ids["near_far"], ids["lift"]})
            process.send_signal(signal.SIGTERM)
            assert process.wait(ANSWER_S) == 0
        finally:
            done.set()
            other.join()
    text = file.with_suffix(".log").read_text()
    assert "bus=crane" not in text
    assert "stopped valves=not-sent" in text
    line.close()


@pytest.mark.slow
def test_two_daemons_share_a_bus_of_datagrams(tmp_path: Path) -> None:
    def without(*axes: str) -> Callable[[dict], None]:  # type: ignore[type-arg]
        def change(content: dict) -> None:  # type: ignore[type-arg]
            for axis in axes:
                del content["axes"][axis]
            if "slew" in axes:
                del content["joysticks"]["left"], content["status"], content["identity"]
            else:
                del content["joysticks"]["right"]

        return change

    first = written(tmp_path / "first.yaml", without("lift"))
    second = written(tmp_path / "second.yaml", without("slew", "near_far"))
    with LocalMulticastBus(GROUP) as bus, running(first) as one, running(second) as other:
        received(bus, {*ids_of(first).values(), *ids_of(second).values()})
        for process, _ in (one, other):
            process.send_signal(signal.SIGTERM)
            assert process.wait(ANSWER_S) == 0
    for file in (first, second):
        text = file.with_suffix(".log").read_text()
        assert "SECOND_SENDER" not in text
        assert "stopped valves=sent" in text
