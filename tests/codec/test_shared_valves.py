"""Valve messages with the commands of several axes."""

from typing import Any

import pytest

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from tests.codec.valve_machine import DBC, network, with_valves
from tests.rigs.files import Machine

BLOCK = "message: Block, timeout_ms: 200, alive_counter: Count"
THREE = (
    ("Slew", f"{BLOCK}, signal: First"),
    ("NearFar", f"{BLOCK}, signal: Second"),
    (
        "Lift",
        f"{BLOCK}, signal: Third,"
        " direction: { signal: ThirdState, neutral: 0, positive: 1, negative: 2 }",
    ),
)


def test_three_axes_in_one_message(machine: Machine) -> None:
    """One frame a tick with the commands of all; its counter counts frames, not axes."""
    deployment = with_valves(machine, *THREE).load()
    controller = Controller(deployment)
    joystick: Any = {m.name: m for m in deployment.messages.all()}
    moved: list[Any] = []
    for n in range(60):
        for side, command in (("Left", {"Slew": 900, "NearFar": -400}), ("Right", {"Lift": -600})):
            message = joystick[f"Joystick{side}"]
            raw = dict.fromkeys((s.name for s in message.signals), 0)
            raw |= {"Enable": 1, "AliveCounter": n % 256, **(command if n > 4 else {})}
            data = message.encode(raw, scaling=False)
            controller.receive(Frame("crane", message.frame_id, False, data), n * 20_000_000)
        sent = [f for f in controller.tick(n * 20_000_000) if f.can_id == 0x500]
        assert len(sent) == 1
        moved.append(network.decode_message("Block", sent[0].data, scaling=False))
    assert [m["Count"] for m in moved] == [(n + 1) % 16 for n in range(60)]
    last = moved[-1]
    assert last["First"] > 40
    assert last["Second"] < -20
    assert (last["Third"], last["ThirdState"]) == (155, 2)  # 60 %, and 5 % for the deadband
    (neutral,) = controller.neutral_frames()
    raw = network.decode_message("Block", neutral.data, scaling=False)
    assert [raw[s] for s in ("First", "Second", "Third", "ThirdState")] == [0, 0, 0, 0]


def test_a_frame_that_is_not_sent_trips_all_of_its_axes(machine: Machine) -> None:
    deployment = with_valves(machine, *THREE).load()
    controller = Controller(deployment)
    (frame,) = (f for f in controller.tick(0) if f.can_id == 0x500)
    controller.receive(frame, 0)
    list(controller.tick(20_000_000))
    assert {r.axis.reason.name for r in controller.axes.values()} == {"SECOND_SENDER"}


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "signal: Second",
            "signal: First",
            "expected a free signal, got 'First', which is axes.slew.valve.signal already",
        ),
        (
            "signal: ThirdState",
            "signal: Count",
            "expected a free signal, got 'Count', which is alive_counter already",
        ),
        ("signal: Second", "signal: Second, alive_counter: null", ""),
    ],
)
def test_no_signal_serves_two(machine: Machine, old: str, new: str, says: str) -> None:
    with_valves(machine, *THREE)
    if not says:
        machine.in_yaml(f"alive_counter: Count, {old}", old)
        says = "alive_counter: expected the same as the other axes of Block, got another"
    else:
        machine.in_yaml(old, new)
    problems = machine.problems()
    assert any(says in problem for problem in problems), problems


def test_a_message_without_a_cycle_is_reported_once(machine: Machine) -> None:
    """Not once for each of its axes, and none of them is bound."""
    with_valves(machine, *THREE)
    text = DBC.replace("BO_ 1280 20;", "BO_ 1280 0;")
    (machine.directory / "valves.dbc").write_text(text, encoding="cp1252")
    (problem,) = machine.problems()
    assert problem == (
        "valves.dbc:12: Block: GenMsgCycleTime: expected a multiple of tick_ms, 20 ms, got none"
    )
