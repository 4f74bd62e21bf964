"""The machine bench: a real daemon on a real bus, which is ended with neutral valves."""

import io
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from canshaper.cli.verbs.commission import Prompts
from canshaper.commissioning.calibration import run
from canshaper.commissioning.calibration.drive import CalibrationDrive
from canshaper.commissioning.calibration.ramp import Ramp, speed_signal
from canshaper.commissioning.procedure.bench import Mode, Task
from canshaper.commissioning.procedure.machine import Machine
from canshaper.commissioning.procedure.traffic import read_traffic
from canshaper.errors import BusError, CalibrationError, UsageError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper_sim.strokes import Script

GROUP = f"239.81.{os.getpid() // 256 % 256}.{os.getpid() % 256}"
BUS = ["--interface", "udp_multicast", "--channel", GROUP]
NEUTRAL = b"stopped valves=sent"
pytestmark = pytest.mark.processes


class Hand:
    """A person who is asked, and whose operator moves the joysticks from then on.

    Args:
        also: called at every step of the progress.
    """

    def __init__(self, also: Any = None) -> None:
        self._also = also
        self._operator: subprocess.Popen[bytes] | None = None
        self.prompts: list[str] = []

    def ready(self, words: str) -> None:
        self.prompts.append(words)
        words_of = ["operator", "machine.yaml", *BUS, "--script", "random-3"]
        self._operator = subprocess.Popen(
            [sys.executable, "-m", "canshaper", *words_of], stdout=subprocess.DEVNULL
        )

    def answer(self, question: str, default: str, _allowed: Sequence[str] = ()) -> str:
        self.prompts.append(question)
        return default

    @contextmanager
    def progress(self, what: str) -> Iterator[Any]:
        try:
            yield self._also or (lambda *_: None)
        finally:
            if self._operator:
                self._operator.terminate()
                self._operator.wait()


@pytest.fixture
def deployment(machine: Path) -> Deployment:
    text = machine.read_text()
    line = "interface: socketcan, channel: can0"
    assert line in text
    machine.write_text(text.replace(line, f"interface: udp_multicast, channel: {GROUP}"))
    return load_deployment(machine)


def task(mode: Mode) -> Task:
    return Task("Move it.", Script("moves", (), 12.0), mode)


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "sends"), [(Mode.SHAPED, True), (Mode.DRY, False)])
def test_a_drive_is_recorded_and_its_daemon_ended(
    deployment: Deployment, mode: Mode, sends: bool
) -> None:
    hand = Hand()
    Machine(hand, []).drive(deployment, Path("drive.log"), task(mode))
    assert hand.prompts == ["Move it."]
    traffic = read_traffic(Path("drive.log"), deployment)
    assert any(axis.joystick.value for axis in traffic.axes.values())
    assert {bool(axis.valve.value) for axis in traffic.axes.values()} == {sends}
    assert all(axis.states for axis in traffic.axes.values())
    assert (NEUTRAL in Path("drive.txt").read_bytes()) is sends


@pytest.mark.slow
def test_ctrl_c_leaves_neutral_valves_and_no_file(deployment: Deployment) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Machine(Hand(interrupted), []).drive(deployment, Path("drive.log"), task(Mode.RAW))
    said = Path("drive.txt").read_bytes()
    assert NEUTRAL in said
    assert b"machine.commission.raw.yaml" in said
    assert not Path("machine.commission.raw.yaml").exists()


@pytest.mark.slow
def test_a_daemon_that_dies_is_reported(deployment: Deployment) -> None:
    def killed(*_: object) -> None:
        for pid in children("run"):
            os.kill(pid, signal.SIGKILL)

    with pytest.raises(UsageError, match="canshaper run ended with status -9"):
        Machine(Hand(killed), []).drive(deployment, Path("drive.log"), task(Mode.SHAPED))


def children(verb: str) -> list[int]:
    """Own child processes of that verb."""
    pids = []
    for line in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split():
        if verb.encode() in Path(f"/proc/{line}/cmdline").read_bytes().split(b"\0"):
            pids.append(int(line))
    return pids


@pytest.mark.slow
def test_the_daemon_ends_with_us(deployment: Deployment, tmp_path: Path) -> None:
    """We are killed in the middle of a drive: the valves are sent neutral all the same."""
    code = (
        "import os, signal; from pathlib import Path\n"
        "from canshaper.cli.verbs.commission import Prompts\n"
        "from canshaper.commissioning.procedure.machine import Machine\n"
        "from canshaper.commissioning.procedure.bench import Mode\n"
        "from canshaper.machine.binding import load_deployment\n"
        "bench = Machine(Prompts(), [])\n"
        "with bench._daemon(load_deployment(Path('machine.yaml')), Path('d.log'), Mode.SHAPED):\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -signal.SIGKILL
    said = tmp_path / "d.txt"
    with subprocess.Popen(["tail", "-n", "+1", "-F", said], stdout=subprocess.PIPE) as tail:
        assert tail.stdout
        assert any(NEUTRAL in line for line in tail.stdout)  # without it the test hangs
        tail.terminate()


@pytest.mark.slow
def test_ctrl_c_ends_a_measurement_and_is_ctrl_c_again(deployment: Deployment) -> None:
    def interrupted(*_: object) -> None:
        os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    speed = speed_signal(deployment, "slew", None)
    drive = CalibrationDrive(deployment, "slew", speed, Ramp(0.03, 0.4))
    try:
        with pytest.raises(KeyboardInterrupt):
            Machine(Hand(interrupted), []).calibrate(deployment, drive, "It moves.")
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert drive.ended == "stopped: Ctrl-C"


def test_a_measurement_that_cannot_begin_ends_by_itself(
    deployment: Deployment, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No one holds the enable: there is no one at all."""
    monkeypatch.setattr(run, "WAIT_LIMIT_S", 0.2)
    speed = speed_signal(deployment, "slew", None)
    drive = CalibrationDrive(deployment, "slew", speed, Ramp(0.03, 0.4))
    Machine(Alone(), []).calibrate(deployment, drive, "It moves.")
    assert drive.ended.startswith("stopped: it did not begin within 0.2 s, it waits for ")
    with pytest.raises(CalibrationError, match=r"not taken to its end: stopped: it did not begin"):
        drive.result()


def test_the_prompt_of_enter_is_clean(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
    Prompts().ready("Move it.")
    assert capsys.readouterr().out == "\n  Move it.\nEnter begins: "


class Alone(Hand):
    """Says that it begins, and does nothing."""

    def ready(self, words: str) -> None:
        self.prompts.append(words)


@pytest.mark.slow
def test_a_bus_that_cannot_be_opened(machine: Path) -> None:
    with pytest.raises(BusError, match=r"canshaper run ended with status 3:\n.*bus "):
        drive = Machine(Hand(), ["--channel", "nowhere9"]).drive
        drive(load_deployment(machine), Path("drive.log"), task(Mode.SHAPED))


def test_who_moves_the_valves_before_the_first_motion(machine: Path) -> None:
    class Says(Hand):
        def answer(self, _question: str, _default: str, allowed: Sequence[str] = ()) -> str:
            assert allowed == ("other", "canshaper")
            return "canshaper"

    hand = Hand()
    assert Machine(hand, []).raw_mode("swing") is Mode.LISTEN
    assert "swing: who moves the valves" in hand.prompts[0]
    assert Machine(Says(), []).raw_mode("swing") is Mode.RAW


def test_an_answer_that_is_none_of_those_allowed(
    machine: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("me\ncanshaper\n"))
    assert Machine(Prompts(), []).raw_mode("swing") is Mode.RAW
    assert "expected one of other, canshaper, got 'me'" in capsys.readouterr().err
