"""Hands that do something else than they should: what is missing, and what to do."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from canshaper.cli.verbs.commission import Prompts
from canshaper.commissioning.procedure.bench import Simulated, Task
from canshaper.commissioning.procedure.files import Files
from canshaper.commissioning.procedure.procedure import Procedure
from canshaper.commissioning.procedure.state import Outcome
from canshaper.machine.binding import load_deployment
from canshaper_sim.strokes import Script, Stroke
from tests.rigs.files import ROOT


class Otherwise(Simulated):
    """The simulated crane, whose operator has a mind of his own."""

    def __init__(self, change: Any) -> None:
        super().__init__(Prompts(), [])
        self._change = change

    def drive(self, deployment: Any, log: Path, task: Task) -> None:
        super().drive(deployment, log, self._change(task))


def run(machine: Path, step: str, change: Any) -> Outcome:
    one = Procedure(Files(machine), Otherwise(change), load_deployment, origin=machine)
    return one.run(one.step(step))


def strokes(change: Any) -> Any:
    def changed(task: Task) -> Task:
        moved = [new for one in task.script.strokes for new in change(one)]
        return replace(task, script=Script("other", tuple(moved), task.script.duration_s))

    return changed


def inverted(one: Stroke) -> list[Stroke]:
    return [replace(one, level=-one.level)]


def shorter(one: Stroke) -> list[Stroke]:
    return [replace(one, level=0.6 * one.level)]


def none(_one: Stroke) -> list[Stroke]:
    return []


def one_sided(one: Stroke) -> list[Stroke]:
    return [replace(one, level=abs(one.level))]


def only_slew(one: Stroke) -> list[Stroke]:
    return [one] if one.axis == "slew" else []


def both(one: Stroke) -> list[Stroke]:
    return [replace(one, axis="slew"), replace(one, axis="near_far")]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "text"),
    [
        (inverted, "slew: went to negative values first: swap the sign of JoystickLeft.Slew"),
        (shorter, "slew: reached -60 to 60 %: move it to both ends"),
        (none, "slew: no signal moved: was it the right joystick?"),
        (both, "slew: several moved (JoystickLeft.Slew, JoystickLeft.NearFar)"),
    ],
)
def test_joysticks_moved_otherwise(machine: Path, change: Any, text: str) -> None:
    before = machine.read_bytes()
    outcome = run(machine, "joysticks", strokes(change))
    assert outcome.problems[0].startswith(text)
    assert not outcome.diff
    assert machine.read_bytes() == before


def released(*times_s: float) -> Any:
    return lambda task: replace(task, released=times_s or None)


EVERY = ["slew", "near_far", "lift"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("step", "change", "axes", "text"),
    [
        ("joysticks", released(0.0, 9.0), EVERY, "slew: the enable switch was not seen held"),
        ("dry", strokes(only_slew), EVERY[1:], "near_far: its joystick went from"),
        (
            "dry",
            released(0.0, 100.0),
            EVERY,
            "slew: it was never ACTIVE, but NEUTRAL_WAIT (ENABLE_",
        ),
        (
            "motion",
            strokes(one_sided),
            EVERY,
            "slew: its valve did not follow its joystick in both",
        ),
    ],
)
def test_a_step_done_otherwise(
    machine: Path, step: str, change: Any, axes: list[str], text: str
) -> None:
    problems = run(machine, step, change).problems
    assert problems[0].startswith(text)
    assert [*dict.fromkeys(fault.partition(":")[0] for fault in problems)] == axes


@pytest.mark.slow
def test_a_first_motion_with_the_enable_held_all_the_time(machine: Path) -> None:
    assert run(machine, "motion", released()).problems == [
        "the enable was not let go while an axis moved, or is in no message of a joystick: let it"
        " go in motion; neutral has to follow at once"
    ]


def test_a_bus_on_which_nothing_comes(machine: Path) -> None:
    class Silent(Otherwise):
        def drive(self, deployment: Any, log: Path, task: Task) -> None:
            log.write_text("")

    bench = Silent(None)
    one = Procedure(Files(machine), bench, load_deployment, origin=machine)
    outcome = one.run(one.step("buses"))
    assert any("bus crane: no frame was received: is the machine on" in f for f in outcome.problems)


class Renamed(Simulated):
    """The simulated crane of ``machine.yaml``, for a file with other names of its axes."""

    def __init__(self, names: dict[str, str]) -> None:
        super().__init__(Prompts(), [])
        self._names = names
        self.tasks: list[Task] = []

    def drive(self, _deployment: Any, log: Path, task: Task) -> None:
        self.tasks.append(task)
        moved = [replace(one, axis=self._names[one.axis]) for one in task.script.strokes]
        script = Script(task.script.name, tuple(moved), task.script.duration_s)
        super().drive(load_deployment(Path("machine.yaml")), log, replace(task, script=script))


@pytest.mark.slow
@pytest.mark.parametrize("step", ["joysticks", "dry", "motion"])
def test_an_axis_has_whatever_name_the_file_gives_it(machine: Path, step: str) -> None:
    names = {"boom": "slew", "front_slew": "near_far", "hoist": "lift"}
    other = renamed(machine, names)
    bench = Renamed(names)
    one = Procedure(Files(other), bench, load_deployment, origin=other)
    proposal = one.run(one.step(step))
    assert proposal.problems == []
    assert {*names} <= proposal.numbers.keys()


def renamed(machine: Path, names: dict[str, str]) -> Path:
    """A copy of a file with these names of its axes."""
    text = machine.read_text()
    for name, known in names.items():
        for old in (f"\n  {known}:", f": {known}\n", f"axes.{known}."):
            assert old in text or known == "lift"
            text = text.replace(old, old.replace(known, name))
    other = machine.with_name("other.yaml")
    other.write_text(text)
    return other


@pytest.mark.slow
@pytest.mark.parametrize("step", ["joysticks", "dry", "motion"])
def test_a_rotator_with_a_rocker_of_two_signals(machine: Path, step: str) -> None:
    add_rotator(machine)
    proposal = run(machine, step, lambda task: task)
    assert proposal.problems == []
    assert not proposal.diff
    assert "rotator" in proposal.numbers


def add_rotator(machine: Path) -> None:
    """As that of a crane of two-cranes.yaml: a rocker with a signal for each direction."""
    shutil.copy(ROOT / "dbc" / "rotator.dbc", ".")
    text = machine.read_text().replace("[machine.dbc]", "[machine.dbc, rotator.dbc]")
    joystick = """  rocker:
    bus: crane
    message: RotatorRocker
    timeout_ms: 100
    enable: Enable
    reset: Reset
    alive_counter: AliveCounter

axes:
  rotator:
    command: { joystick: rocker, signal: RotateLeft, negative: RotateRight, neutral_pct: 2 }
    valve: { bus: crane, message: RotatorCommand, signal: Velocity, timeout_ms: 200 }
    filter: { kind: off }
    limits: { max_pct: 40, rise_per_s: 5, fall_per_s: 5, tail_s: 0.5, stop_s: 0.5 }
"""
    machine.write_text(text.replace("\naxes:\n", joystick))


@pytest.mark.slow
@pytest.mark.parametrize("step", ["buses", "joysticks", "swing", "dry", "motion", "drive"])
def test_a_person_reads_how_long_it_records_and_who_may_move_the_crane(
    machine: Path, step: str
) -> None:
    """In joysticks and dry the controller of before may."""
    bench = Renamed({"slew": "slew", "near_far": "near_far", "lift": "lift"})
    one = Procedure(Files(machine), bench, load_deployment, origin=machine)
    one.run(one.step(step))
    assert bench.tasks
    for task in bench.tasks:
        assert f" {task.script.duration_s:.0f} s" in task.words
        warned = "the controller of before moves the crane wherever it is connected" in task.words
        assert warned == (step in ("joysticks", "dry"))


@pytest.mark.slow
def test_two_axis_motion_begins_after_the_first_motion(first_day: Path) -> None:
    assert load_deployment(first_day).motions == {}
    one = Procedure(Files(first_day), Otherwise(lambda t: t), load_deployment, first_day)
    proposal = one.run(one.step("motion"))
    assert "-    waits: true" in proposal.diff
    one.accept(proposal)
    assert {*load_deployment(first_day).motions} == {"crane"}
