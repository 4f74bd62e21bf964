"""Interfaces that fail now and then: each error costs a line, is counted, and ends nothing."""

import re
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from canshaper.cli.common import loader
from canshaper.commissioning.monitor.run import run_plain
from canshaper.commissioning.nodes.parameters import _connected
from canshaper.config.bus import Bus
from canshaper.errors import BusError
from canshaper.machine.deployment import Deployment
from canshaper.recording.listen import Listener, ReceivedFrame
from canshaper.recording.log import LogFile
from canshaper.recording.record import Recording
from tests.bus.lines import SerialLine, until

GARBLED = [
    b"t1108ZZ00000001000000\r",  # no digits
    b"boot: hello\r",  # of the adapter's own program
    b"t11\r",  # the end is missing
    b"\xfft1101AA\r",  # no text: slcan keeps it
    b"t9\xe9\xe9\r",
]
GOOD = b"t1102%02X00\r"


@pytest.fixture
def line() -> Iterator[SerialLine]:
    made = SerialLine()
    yield made
    made.close()


def slcan(line: SerialLine) -> Bus:
    return Bus(interface="slcan", channel=line.path, options={"sleep_after_open": 0.0})


def deployment_on(line: SerialLine) -> Deployment:
    deployment = loader("forwarder.yaml", "slcan", [line.path])()
    deployment.config.buses["crane"].options["sleep_after_open"] = 0.0
    return deployment


@pytest.mark.parametrize("text", GARBLED)
def test_a_garbled_line_costs_that_line(line: SerialLine, text: bytes) -> None:
    listener = Listener([("crane", slcan(line))])
    line.write(GOOD % 1 + text + GOOD % 2)
    frames: list[ReceivedFrame] = []
    until(lambda: frames.extend(listener.frames(0.0)) or len(frames) == 2)
    listener.close()
    assert [frame.data[0] for frame in frames] == [1, 2]
    assert listener.errors == {"crane": 1}
    assert re.match("bus crane: .*Error", listener.last_error)


@pytest.mark.parametrize("suffix", ["log", "mcap"])
def test_a_recording_goes_on_and_counts(line: SerialLine, tmp_path: Path, suffix: str) -> None:
    recording = Recording(deployment_on(line))
    written = iter((*GARBLED, *(GOOD % i for i in range(3))))

    def going(so_far: Recording) -> bool:
        line.write(next(written, b""))
        return so_far.frames.total() < 3

    path = tmp_path / f"drive.{suffix}"
    recording.run(path, 30.0, going)
    assert [frame.data[0] for frame in LogFile(path)] == [0, 1, 2]
    assert f"3 frames, {len(GARBLED)} ERRORS of the interface, the last bus crane: " in str(
        recording
    )


def test_a_monitor_says_it(line: SerialLine) -> None:
    said: list[str] = []

    def going() -> bool:
        line.write(GARBLED[0] * (not said))
        return not said

    run_plain(deployment_on(line), said.append, going)
    assert "bus crane: ValueError" in said[0]


def test_a_bus_that_does_nothing_but_fail_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    class Gone:
        calls = 0

        def recv(self, _timeout_s: float) -> None:
            self.calls += 1
            if self.calls != 151:  # a silence among errors: it is there
                raise OSError(5, "Input/output error")

        def shutdown(self) -> None:
            raise RuntimeError("closed twice")

    monkeypatch.setattr(can, "Bus", lambda **_: Gone())
    listener = Listener([("crane", Bus(interface="kvaser", channel="0"))])
    with pytest.raises(BusError, match="bus crane: cannot read 0: Input/output error"):
        for _ in range(100):
            assert listener.frames(0.0) == []
    assert listener.errors["crane"] == 150 + 200  # from the last silence on
    listener.close()


@pytest.mark.processes
def test_nodes_answer_behind_a_garbled_line(line: SerialLine) -> None:
    with _connected(slcan(line)) as network:
        received: list[int] = []
        network.subscribe(0x110, lambda _id, data, _time: received.append(data[0]))
        line.write(b"".join(GARBLED[:3]) + GOOD % 7)
        until(lambda: received)
    assert received == [7]
