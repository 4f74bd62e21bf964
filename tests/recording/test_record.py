"""Recording a real daemon on python-can's multicast bus, and nothing but listening."""

import json
import os
import select
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest

from canshaper.bus.multicast import LocalMulticastBus
from canshaper.cli.common import loader
from canshaper.recording.listen import Listener
from canshaper.recording.record import Recording, unpack
from tests.cli.invocation import invoke
from tests.rigs.files import machine_file

# Of this process alone: two runs of the tests on one machine must not receive each other's frames.
GROUP = f"239.74.{os.getpid() // 256 % 256}.{os.getpid() % 256}"
BUS = ("--interface", "udp_multicast", "--channel", GROUP)
ANSWER_S = 120.0


@contextmanager
def running(
    verb: str, *options: str, log: Path, file: str = "forwarder.yaml"
) -> Iterator[subprocess.Popen[bytes]]:
    command = [sys.executable, "-m", "canshaper", verb, file, *BUS, *options]
    with log.open("wb") as output:
        process = subprocess.Popen(command, stdout=output, stderr=output)
    try:
        yield process
    finally:
        process.terminate()
        process.wait(ANSWER_S)


@pytest.mark.slow
def test_what_a_daemon_does_is_recorded(tmp_path: Path) -> None:
    recording = Recording(loader("forwarder.yaml", "udp_multicast", [GROUP])())
    until = time.monotonic() + 2 * ANSWER_S

    def going(so_far: Recording) -> bool:
        assert time.monotonic() < until
        ready = any("state=READY" in change.text for change in so_far.history.changes)
        return not ready or so_far.frames[""] <= 20

    with running("run", log=tmp_path / "run"), running("operator", log=tmp_path / "operator"):
        recording.run(tmp_path / "drive.log", None, going)
    assert recording.lost == 0
    assert recording.frames[""] > 20


@pytest.mark.slow
def test_a_running_daemon_writes_its_last_minute(tmp_path: Path) -> None:
    """A real one, with a clock, a bus and a control socket; what it did is played the same."""
    control = "control: { adjustable: { axes.slew.filter.a1: [0.5, 1.0] } }\n"
    file, socket = machine_file(tmp_path, "forwarder", more=control), str(tmp_path / "socket")
    boxes = tmp_path / "boxes"
    boxes.mkdir()
    last = ["record", str(file), "--last", "--control", socket]
    assert invoke(*last).exit_code == 1  # no daemon yet
    options = ("--control", socket, "--black-box", str(boxes))
    with (
        running("run", *options, log=tmp_path / "run", file=str(file)),
        running("operator", "--script", "pulse-slew", log=tmp_path / "operator") as operator,
    ):
        assert operator.wait(ANSWER_S) == 0
        changed = invoke("set", file, "axes.slew.filter.a1=0.75", "--control", socket)
        assert changed.exit_code == 0, changed.output
        result = invoke(*last)
    assert result.exit_code == 0, result.output + (tmp_path / "run").read_text()
    assert f"written in {boxes}" in result.output.replace("\n", "")
    bundles = sorted(boxes.iterdir())
    out = tmp_path / "out"
    played = ["replay", str(bundles[0]), "--verify", "--out", str(out)]
    result = invoke(*played)
    assert result.exit_code == 0, result.output
    assert "every one the same to the last bit" in result.output
    data = json.loads((out / "replay.json").read_text())["machine"]
    assert data["ticks"] > 100
    assert data["received"]["crane 0x110"] > 100


@pytest.mark.slow
def test_the_command_makes_a_bundle_and_ends_with_ctrl_c(tmp_path: Path) -> None:
    out = tmp_path / "bundle.zip"
    mine = tmp_path / "bundle.log"
    mine.write_text("another recording\n")
    with (
        running("operator", log=tmp_path / "operator"),
        running("record", "--out", str(out), log=tmp_path / "record") as record,
    ):
        until = time.monotonic() + ANSWER_S
        while (
            sum(log.stat().st_size for log in tmp_path.glob("bundle.*.log")) < 10_000
        ):  # 170 lines
            assert time.monotonic() < until, (tmp_path / "record").read_text()
            time.sleep(0.05)
        record.send_signal(signal.SIGINT)
        assert record.wait(ANSWER_S) == 0, (tmp_path / "record").read_text()
    assert sorted(tmp_path.glob("bundle*")) == [mine, out]
    assert mine.read_text() == "another recording\n"
    with zipfile.ZipFile(out) as bundle:
        about = json.loads(bundle.read("about.json"))
        rows = bundle.read("recording.log").decode().splitlines()
    assert about["ended"] == "as asked"
    assert about["frames"]["data"] == len(rows) > 100
    assert {row.split()[2][:4] for row in rows} == {"110#", "111#"}
    assert {row.split()[1] for row in rows} == {GROUP}


def test_a_bus_that_cannot_be_opened_ends_with_3(tmp_path: Path) -> None:
    arguments = ["record", "forwarder.yaml", "--interface", "nothing", "--channel", "x"]
    result = invoke(*arguments, "--out", tmp_path / "x.zip")
    assert result.exit_code == 3
    assert "bus crane: cannot open nothing channel x" in result.output
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["none.zip", "none.log"])
def test_a_silent_bus_gives_a_file_without_frames(tmp_path: Path, name: str) -> None:
    out = tmp_path / name
    result = invoke("record", "forwarder.yaml", *BUS, "--seconds", "0.2", "--out", out)
    assert result.exit_code == 0, result.output
    assert f"nothing was received, {out} is without frames: is the bus up" in result.output
    assert ", 0 frames" in result.output
    assert list(tmp_path.iterdir()) == [out]
    log = out
    if out.suffix == ".zip":
        log, _ = unpack(out, tmp_path / "there")
        assert json.loads((tmp_path / "there" / "about.json").read_text())["frames"] == {}
    assert log.read_text() == ""


def test_a_log_that_cannot_be_written_ends_with_1(tmp_path: Path) -> None:
    arguments = ["record", "forwarder.yaml", *BUS, "--seconds", "0.2"]
    result = invoke(*arguments, "--out", tmp_path / "no" / "x.zip")
    assert result.exit_code == 1
    assert "No such file or directory" in result.output


def test_only_bundles_and_logs(tmp_path: Path) -> None:
    result = invoke("record", "forwarder.yaml", "--out", "x.tar")
    assert result.exit_code == 2
    assert "expected .zip, .log, .mcap, .mf4, got " in result.output


def test_a_listener_receives_everything_and_sends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[can.Message] = []
    bus_type = can.interfaces.udp_multicast.UdpMulticastBus
    really = bus_type.send
    monkeypatch.setattr(bus_type, "send", lambda self, m, timeout=None: sent.append(m))
    listener = Listener(loader("forwarder.yaml", "udp_multicast", [GROUP])().config.buses.items())
    other = LocalMulticastBus(GROUP)
    messages = [
        can.Message(arbitration_id=0x110, is_extended_id=False, data=b"\x01\x02"),
        can.Message(arbitration_id=0x1ABCDEF0, data=b""),
        can.Message(arbitration_id=0x111, is_extended_id=False, is_remote_frame=True, dlc=0),
    ]
    try:
        for message in messages:
            really(other, message)
        received = []
        while len(received) < len(messages):
            assert select.select([other.fileno()], [], [], ANSWER_S)[0]
            received += listener.frames()
    finally:
        listener.close()
        other.shutdown()
    assert [(h.can_id, h.extended, h.data, h.kind) for h in received] == [
        (0x110, False, b"\x01\x02", ""),
        (0x1ABCDEF0, True, b"", ""),
        (0x111, False, b"", "remote"),
    ]
    assert [h.line().split(" ", 1)[1] for h in received] == [
        f"{GROUP} 110#0102\n",
        f"{GROUP} 1ABCDEF0#\n",
        f"{GROUP} 111#R\n",
    ]
    assert sent == []
