"""The step ``drive`` of a machine: what is measured is judged, what is not a person judges."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from canshaper.cli.verbs.commission import Prompts
from canshaper.commissioning.procedure.bench import Mode, Simulated, Task
from canshaper.commissioning.procedure.files import Files
from canshaper.commissioning.procedure.procedure import Procedure
from canshaper.commissioning.procedure.state import Outcome, Record, Status
from canshaper.machine.binding import load_deployment
from canshaper_sim.strokes import Script, Stroke
from tests.rigs.files import machine_file

SIGNALS = {"slew": "GrappleSway.SwayPerpendicular", "near_far": "GrappleSway.SwayParallel"}
BEFORE, AFTER = "drive-before.log", "drive-after.log"
Change = Callable[[Task], Task]


class Driver(Prompts):
    """Sees what it is given to see."""

    def __init__(self, saw: str = "") -> None:
        self._saw = saw
        self.questions: list[str] = []

    def answer(self, question: str, default: str, allowed: Sequence[str] = ()) -> str:
        self.questions.append(question)
        assert self._saw in ("", *allowed)
        return self._saw or default


class Live:
    """A machine: the simulated crane, of which only its bus is known."""

    simulated = False

    def __init__(self, person: Driver, change: Change, without: Callable[[str, float], bool]):
        self.person, self.changes = person, list[str]()
        self._crane = Simulated(person, [])
        self._change, self._without = change, without

    def drive(self, deployment: Any, log: Path, task: Task) -> None:
        """Frames are left out of the log where ``without`` says so of its name and time."""
        self._crane.drive(deployment, log, self._change(task))
        lines = log.read_text().splitlines(keepends=True)
        sway = f" {deployment.messages.find('GrappleSway')[1].frame_id:03X}#"
        log.write_text(
            "".join(
                line
                for line in lines
                if sway not in line or not self._without(log.name, float(line[1:].split(")")[0]))
            )
        )

    def raw_mode(self, _step: str) -> Mode:
        return Mode.RAW

    def calibrate(self, *_: object) -> None:
        raise AssertionError


def drive(
    machine: Path,
    driver: Driver,
    signals: dict[str, str],
    change: Change = lambda task: task,
    without: Callable[[str, float], bool] = lambda _log, _time_s: False,
) -> tuple[Procedure, Outcome]:
    # As the step valve would have measured it.
    machine.write_text(machine.read_text().replace("deadband_pct: 0", "deadband_pct: 5"))
    one = Procedure(Files(machine), Live(driver, change, without), load_deployment)
    numbers = {name: {"signal": signal} for name, signal in signals.items()}
    one.state.steps["swing"] = Record(Status.DONE, numbers=numbers)
    return one, one.run(one.step("drive"))


def only(mode: Mode, change: Callable[[Stroke], list[Stroke]]) -> Change:
    """Of the drive in that mode other strokes."""

    def changed(task: Task) -> Task:
        if task.mode is not mode:
            return task
        moved = [new for one in task.script.strokes for new in change(one)]
        return replace(task, script=Script("other", tuple(moved), task.script.duration_s))

    return changed


@pytest.mark.slow
def test_a_measured_swing_is_judged_as_that_of_the_simulated_crane(machine: Path) -> None:
    driver = Driver()
    one, proposal = drive(machine, driver, SIGNALS)
    assert proposal.problems == []
    measured: Any = proposal.numbers["crane"]
    copy = machine.with_name("copy.yaml")
    copy.write_bytes(machine.read_bytes())
    other = Procedure(Files(copy), Simulated(Prompts(), []), load_deployment, origin=copy)
    simulated: Any = other.run(other.step("drive")).numbers["crane"]
    for name in ("residual_before_deg", "residual_after_deg"):
        assert measured[name] == pytest.approx(simulated[name], abs=0.1)
    assert 0.0 < measured["residual_left_pct"] < 10.0
    assert driver.questions == []
    one.accept(proposal)
    assert one.state.of("drive").why == ""


@pytest.mark.slow
def test_a_filter_that_takes_no_swing_away_is_a_problem(machine: Path) -> None:
    text = machine.read_text()
    lines = [
        "    filter: { kind: off }" if "kind: robust" in one else one for one in text.split("\n")
    ]
    machine.write_text("\n".join(lines))
    _, proposal = drive(machine, Driver(), SIGNALS)
    assert "% of the swing is left" in proposal.problems[0]


@pytest.mark.slow
def test_what_nothing_measures_is_judged_by_eye(machine: Path) -> None:
    driver = Driver("less")
    one, proposal = drive(machine, driver, {})
    assert "drive: by eye: slew, near_far: I drove both times, and saw" in driver.questions[0]
    assert proposal.problems == []
    assert "crane" not in proposal.numbers
    one.accept(proposal)
    assert one.state.of("drive").why == "slew, near_far judged by eye"
    assert proposal.numbers["slew"] == {"judged": "by eye", "saw": "less"}
    one.accept(one.run(one.step("report")))
    report = (Files(machine).folder / "report.html").read_text()
    assert "<h2>drive: done, slew, near_far judged by eye</h2>" in report
    assert "NOTHING MEASURED the swing of slew, near_far" in report


@pytest.mark.slow
@pytest.mark.parametrize(
    ("saw", "text"),
    [
        ("", "slew, near_far: nothing measured the swing, and no one has judged it by eye"),
        ("same", "slew, near_far: by eye the filters take no swing away"),
    ],
)
def test_nothing_measured_and_nothing_seen_is_no_yes(machine: Path, saw: str, text: str) -> None:
    one, proposal = drive(machine, Driver(saw), {})
    assert [fault.startswith(text) for fault in proposal.problems] == [True]
    assert one.state.of("drive").status is Status.OPEN


@pytest.mark.slow
def test_one_of_two_planes_is_measured_the_other_judged_by_eye(machine: Path) -> None:
    driver = Driver("less")
    one, proposal = drive(machine, driver, {"slew": SIGNALS["slew"]})
    assert proposal.problems == []
    assert {*proposal.numbers} == {"crane", "near_far"}
    assert len(driver.questions) == 1
    one.accept(proposal)
    assert one.state.of("drive").why == "near_far judged by eye"


@pytest.mark.slow
@pytest.mark.parametrize("mode", [Mode.RAW, Mode.SHAPED])
def test_a_drive_in_which_nothing_moved(machine: Path, mode: Mode) -> None:
    """Neither measured nor by eye."""
    when = {Mode.RAW: "before", Mode.SHAPED: "after"}[mode]
    driver = Driver("less")
    _, proposal = drive(machine, driver, {}, only(mode, lambda _one: []))
    text = "its joystick was moved for 0.0 s of full deflection in the drive"
    assert proposal.problems == [f"{n}: {text} {when}: drive it as it says" for n in SIGNALS]
    assert driver.questions == []
    assert [path.name for path in proposal.pictures if path.suffix == ".png"] == [
        "drive-before.png",
        "drive-after.png",
    ]


@pytest.mark.slow
def test_a_drive_without_enable(machine: Path) -> None:
    _, proposal = drive(
        machine, Driver("less"), {}, lambda task: replace(task, released=(0.0, 99.0))
    )
    assert (
        "slew: its valve received no motion in the drive before: hold the enable"
        in proposal.problems[0]
    )


@pytest.mark.slow
def test_another_drive_with_the_filters_than_without(machine: Path) -> None:
    change = only(Mode.SHAPED, lambda one: [replace(one, level=0.4 * one.level)])
    _, proposal = drive(machine, Driver(), SIGNALS, change)
    assert all("drive the same both times" in fault for fault in proposal.problems)
    assert len(proposal.problems) == 2


@pytest.mark.slow
def test_a_drive_without_a_rest(machine: Path) -> None:
    def changed(task: Task) -> Task:
        end_s = task.script.duration_s - 1.0
        strokes = (Stroke("slew", 0.5, end_s - 0.5, 0.5), Stroke("near_far", 0.5, 2.0, 0.4))
        return replace(task, script=Script("on", strokes, task.script.duration_s))

    _, proposal = drive(machine, Driver(), SIGNALS, changed)
    assert proposal.problems[0].startswith("no rest of 3.5 s after all joysticks were let go")


@pytest.mark.slow
@pytest.mark.parametrize("log", [BEFORE, AFTER])
def test_a_sensor_that_falls_silent_is_no_grapple_that_hangs_still(machine: Path, log: str) -> None:
    def without(name: str, time_s: float) -> bool:
        return name == log and time_s > 4.0

    _, proposal = drive(machine, Driver(), SIGNALS, without=without)
    assert "slew: drive-" in proposal.problems[0]
    assert "SwayPerpendicular: no value for 13." in proposal.problems[0]


@pytest.mark.slow
def test_a_speed_is_no_swing(machine: Path) -> None:
    driver = Driver("less")
    _, proposal = drive(machine, driver, dict.fromkeys(SIGNALS, "TipVelocity.RadialSpeed"))
    assert "crane" not in proposal.numbers
    assert len(driver.questions) == 1


@pytest.mark.slow
def test_without_the_step_swing_the_sway_sensor_measures(machine: Path) -> None:
    slow = ("limits: {", "limits: { max_pct: 40,")
    machine_file(machine.parent, "forwarder-sensor", slow)
    driver = Driver()
    _, proposal = drive(machine, driver, {})
    assert proposal.problems == []
    assert driver.questions == []
    shown = "\n".join(part["text"] for part in proposal.sheet.parts if "text" in part)
    assert "Swing measured: slew by SwayAngle.Across, near_far by SwayAngle.Along" in shown
