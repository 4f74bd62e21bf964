"""``canshaper commission`` on real SocketCAN: a plant and a hand of its own, to the report."""

import json
import re
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import can
import pytest

from canshaper.commissioning.procedure.files import Files
from canshaper.commissioning.procedure.state import Record, State, Status, write_state
from canshaper.machine.binding import load_deployment
from tests.hil.machine import (
    ANSWER_S,
    DBC,
    VALVES,
    Joysticks,
    joysticks_on,
    open_bus,
    service,
)
from tests.rigs.files import machine_file

DONE = ("buses", "joysticks", "check", "dry", "motion", "drive", "report")
# What takes minutes, and has tests of its own.
SKIPPED = ("swing", "valve", "filter", "sensor")
VALVE_IDS = {DBC.get_message_by_name(name).frame_id for name in VALVES}
SIGNALS = {"slew": "Slew", "near_far": "NearFar", "lift": "Lift"}
TRIES = 3  # where an emulated machine stands still, a joystick times out and its axis trips
Stroke = tuple[float, dict[str, float], int]  # for so many seconds, signals in percent, enable

REST: Stroke = (1.0, {}, 1)


def ends(axes: list[str], percent: float) -> list[Stroke]:
    """Each joystick to both ends, one after the other."""
    held = [(1.5, {SIGNALS[name]: way * percent}, 1) for name in axes for way in (1.0, -1.0)]
    return [one for stroke in held for one in (stroke, (3.0, {}, 1))]


def work(step: str, words: str) -> tuple[str, list[Stroke]]:
    """Do the task of these words as a person does, and return the log of it."""
    if moved := re.search(r"move the joystick of (\w+) to its end", words):
        return f"joystick-{moved[1]}", ends([moved[1]], 100.0)
    if step == "dry":
        return "dry", ends([*SIGNALS], 100.0)
    if step == "motion":
        slew = {"Slew": 40.0}
        return "motion", [*ends([*SIGNALS], 40.0), (1.0, slew, 1), (1.0, slew, 0), (1.0, {}, 0)]
    if step == "drive":
        both = {"Slew": 90.0, "NearFar": 80.0}
        back = {name: -percent for name, percent in both.items()}
        log = "drive-before" if "Filters off" in words else "drive-after"
        return log, [(2.0, both, 1), (5.5, {}, 1), (2.0, back, 1)]
    return step, []


class Valves(can.Listener):
    """Every frame of a valve on the bus: how many, and the last commands."""

    def __init__(self) -> None:
        self.frames = 0
        self.commands: dict[int, int] = {}

    def on_message_received(self, message: can.Message) -> None:
        self.frames += 1
        self.commands[message.arbitration_id] = message.data[0]


class Person:
    """Reads what ``commission`` prints, and moves the joysticks as it says."""

    def __init__(self, folder: Path, joysticks: Joysticks, valves: "Valves") -> None:
        self._folder, self._joysticks, self._valves = folder, joysticks, valves
        self.steps: list[str] = []
        self.text = ""
        self.frames_before_motion = 0

    def follow(self, process: "subprocess.Popen[str]") -> int:
        """Until it ends; its status."""
        assert process.stdout
        for line in process.stdout:
            self.text += line
            if header := re.match(r"\[\d+/\d+\] (\w+):", line):
                if "motion" not in self.steps:
                    self.frames_before_motion = self._valves.frames
                self.steps.append(header[1])
            elif line.startswith("  ") and re.search(r"\d s\b", line) and self.steps:
                self._do(*work(self.steps[-1], line), process)
        return process.wait(ANSWER_S)

    def _do(self, log: str, strokes: list[Stroke], process: "subprocess.Popen[str]") -> None:
        """Move as soon as it records."""
        path, before = self._folder / f"{log}.log", time.time()
        pause = threading.Event()
        while process.poll() is None and not (path.exists() and path.stat().st_mtime >= before):
            pause.wait(0.02)
        for seconds, signals, enable in [REST, *strokes, REST]:
            self._joysticks.values.update(dict.fromkeys(SIGNALS.values(), 0.0) | signals)
            self._joysticks.switches["Enable"] = enable
            pause.wait(seconds)  # that is how long a person holds it


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A crane with a sway sensor, whose swing was identified before."""
    copy = machine_file(tmp_path, "forwarder-sensor")
    skipped = {name: Record(Status.SKIPPED, why="left out") for name in SKIPPED}
    write_state(Files(copy).state, State(steps=skipped))
    return copy


def commission(file: Path, person: Person) -> int:
    """The status of the command; it goes on where it stopped before."""
    words = [sys.executable, "-u", "-m", "canshaper", "commission", str(file), "--yes"]
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        return person.follow(process)


def test_from_the_buses_to_the_report(file: Path, tmp_path: Path) -> None:
    with (
        service(tmp_path / "sim.log", "sim", str(file)),
        joysticks_on("vcan0") as joysticks,
        open_bus("vcan0") as bus,
    ):
        bus.set_filters([{"can_id": one, "can_mask": 0x7FF} for one in VALVE_IDS])
        valves = Valves()
        notifier = can.Notifier(bus, [valves])
        person = Person(Files(file).folder, joysticks, valves)
        for _ in range(TRIES):
            if (status := commission(file, person)) != 1:
                break
        notifier.stop()
    assert status == 0, person.text
    steps: Any = json.loads(Files(file).state.read_text())["steps"]
    expected = dict.fromkeys(DONE, "done") | dict.fromkeys(SKIPPED, "skipped")
    assert {name: one["status"] for name, one in steps.items()} == expected
    assert person.frames_before_motion == 0
    assert valves.frames > 1000
    assert valves.commands == dict.fromkeys(VALVE_IDS, 0)
    assert {axis.limits.max_pct for axis in load_deployment(file).config.axes.values()} == {40.0}
    for name, signal in (("slew", "Slew"), ("near_far", "NearFar")):
        assert steps["joysticks"]["numbers"][name]["signal"] == f"JoystickLeft.{signal}"
    assert all("ACTIVE" in steps["dry"]["numbers"][name]["states"] for name in SIGNALS)
    assert steps["motion"]["numbers"]["enable_to_neutral_s"] <= 0.1
    crane = steps["drive"]["numbers"]["crane"]
    assert crane["residual_before_deg"] > 5.0 > crane["residual_after_deg"]
    assert steps["drive"]["why"] == ""  # measured, not judged by eye
    report = (Files(file).folder / "report.html").read_text(encoding="utf-8")
    assert "REHEARSAL" not in report
    for name in DONE[:-1]:
        assert f"<h2>{name}: done</h2>" in report
