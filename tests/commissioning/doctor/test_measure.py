"""Notes of loop and joysticks brought together; the hand that moves every axis."""

import math
import os
import signal
from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from canshaper.commissioning.doctor.joysticks import LARGEST, NEUTRAL_S, STROKE_S, Waving
from canshaper.commissioning.doctor.measure import measure, run_of
from canshaper.commissioning.doctor.processes import Children, ready
from canshaper.controller.controller import Controller
from canshaper.errors import MeasurementError
from canshaper.machine.binding import load_deployment
from canshaper_sim.joysticks import JoystickNode
from tests.commissioning.doctor.conftest import SHIPPED
from tests.rigs.files import ROOT

MS = 1_000_000
WAVING = Waving("waving", (), math.inf)


def record(**changes: Any) -> dict[str, Any]:
    empty = {"late_ns": [], "began_ns": [], "ended_ns": [], "received": [], "sent": []}
    rest = {"missed": 0, "events": [], "moved": [], "faults": {}, "policy": None, "memory": None}
    return {**empty, **rest, **changes}


def ms(values: Iterable[int]) -> list[float]:
    return [value / MS for value in values]


def test_a_joystick_frame_is_answered_by_the_valve_frame_of_the_tick_that_took_it() -> None:
    deployment = load_deployment(
        SHIPPED
    )  # slew and near_far on the left joystick, lift on the right
    left, right = 0, 1
    sent = [[left, 1], [left, 4], [right, 5], [left, 13], [left, 18], [right, 19], [left, 45]]
    notes = record(
        late_ns=[0, 1 * MS, 2 * MS],
        began_ns=[10 * MS, 30 * MS, 50 * MS],
        ended_ns=[12 * MS, 33 * MS, 54 * MS],
        received=[1, 4, 7],
        sent=[
            *(0, 0, 10 * MS, 0, 1, 11 * MS, 0, 2, 11 * MS),
            *(1, 0, 31 * MS, 1, 1, 31 * MS, 1, 2, 32 * MS),
            *(2, 0, 51 * MS, 2, 1, 52 * MS),  # the frame of lift did not go out
        ],
    )
    run = run_of(deployment, notes, {"crane": [(n, t * MS) for n, t in sent]})
    slew = [31 - 4, 31 - 13, 51 - 18, 51 - 45]
    near_far = [31 - 4, 31 - 13, 52 - 18, 52 - 45]
    assert ms(run.joystick_ns) == [*slew, *near_far, 32 - 5]
    assert ms(run.valve_ns) == [1, 2, 2]
    assert ms(run.tick_ns) == [2, 3, 4]
    assert ms(run.late_ns) == [1, 2]  # the first one is late after nothing


def test_buses_and_slow_valves_are_kept_apart(two_buses: Path) -> None:
    deployment = load_deployment(two_buses)
    notes = record(
        late_ns=[0] * 4,
        began_ns=[t * MS for t in (10, 20, 30, 40)],
        ended_ns=[t * MS for t in (11, 21, 31, 41)],
        received=[*(0, 0), *(1, 0), *(1, 2), *(2, 2)],  # crane, boom
        sent=[
            *(0, 0, 10 * MS, 0, 1, 10 * MS, 0, 2, 10 * MS),
            *(2, 0, 32 * MS, 2, 1, 32 * MS, 2, 2, 33 * MS),  # every second tick
        ],
    )
    hand = {"crane": [(0, 15 * MS), (0, 38 * MS)], "boom": [(-1, 21 * MS), (1, 25 * MS)]}
    run = run_of(deployment, notes, hand)
    assert ms(run.joystick_ns) == [32 - 15, 32 - 15, 33 - 25]


def test_the_hand() -> None:
    times = [i / 1000 for i in range(10_000)]
    values = [WAVING.command("any axis", t) for t in times]
    assert all(v == 0.0 for v in values[: round(1000 * NEUTRAL_S)])
    assert max(values) == pytest.approx(LARGEST, abs=0.01)
    assert min(values) == pytest.approx(-LARGEST, abs=0.01)
    assert max(abs(b - a) for a, b in pairwise(values)) < 0.003  # no jump
    moving = [v for t, v in zip(times, values, strict=True) if t % (NEUTRAL_S + STROKE_S) > 0.21]
    assert all(moving)


@pytest.mark.parametrize("name", ["forwarder", "forwarder-robust", "forwarder-joints", "two_buses"])
def test_the_hand_moves_every_axis(name: str, request: pytest.FixtureRequest) -> None:
    shipped = ROOT / "config" / f"{name}.yaml"
    path = shipped if shipped.exists() else request.getfixturevalue(name)
    deployment = load_deployment(path)
    controller, node = Controller(deployment), JoystickNode(deployment, WAVING)
    tick_ms = deployment.config.tick_ms
    moved: dict[str, set[bool]] = {name: set() for name in controller.axes}
    for time_ms in range(0, 3000, 10):
        for frame in node.frames(time_ms):
            controller.receive(frame, time_ms * MS)
        if time_ms % tick_ms == 0:
            list(controller.tick(time_ms * MS))
        for axis, control in controller.axes.items():
            if control.axis.output.steps:
                moved[axis].add(control.axis.output.steps > 0)
    assert all(ways == {False, True} for ways in moved.values()), moved
    assert not any(controller.counters.values.values())


def children() -> list[int]:
    return [int(p) for p in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()]


@pytest.mark.slow
def test_no_process_outlives_its_block() -> None:
    before = children()
    with pytest.raises(ZeroDivisionError), Children() as processes:
        busy = processes.start("processes", kind="busy")
        ready(busy)
        assert children() == [*before, busy.pid]
        raise ZeroDivisionError
    assert busy.returncode == -signal.SIGKILL
    assert children() == before


@pytest.mark.slow
def test_a_process_that_fails_says_why_and_leaves_no_other() -> None:
    before = children()
    gone = replace(load_deployment(SHIPPED), path=Path("gone.yaml"))
    with pytest.raises(MeasurementError, match=r"gone\.yaml: No such file"):
        measure(gone, 0.5, lambda _: None, load=True)
    assert children() == before


@pytest.mark.slow
def test_two_buses_with_all_that_a_deployment_may_have(two_buses: Path) -> None:
    reported: list[float] = []
    run = measure(load_deployment(two_buses), 0.5, reported.append, load=False)
    assert reported == sorted(reported)
    assert run.joystick_ns
    assert min(run.joystick_ns) > 0
    assert len(run.tick_ns) == len(run.late_ns) + 1
    assert len(run.valve_ns) <= (len(run.tick_ns) + run.missed) // 2 + 1  # every second tick
    assert "SendFailures" not in run.faults
