"""Sequences of faults on every deployment as it is shipped: nothing that the rules forbid.

More, and one again: ``python -m tests.faults SEED --deployment NAME``.
"""

import random
from collections import Counter
from typing import Any
from unittest.mock import patch

import pytest

from canshaper.controller import measured_limits
from canshaper.controller.controller import Controller
from canshaper.shaping.demand_bounds import FlowBudget
from tests.faults import later
from tests.faults.judge import Violation
from tests.faults.lies import LIES, Lie
from tests.faults.sequence import ACTS, LATER, SENDING, Sequence, kinds_for
from tests.faults.shipped import CONFIG, MADE, NAMES, shipped

# So many a deployment in ``make test``, and so many in all.
QUICK, SAMPLE = 1, 18
# So many sequences may a lie stay unseen.
MOST = 200
BUDGET, BOUNDS = FlowBudget.step, measured_limits.bounds  # as they are
# Seen after many sequences.
RARE = {"always active", "another sender unseen", "emergency unseen", "enable forced"}
RARE |= {"error code unseen"}


@pytest.mark.parametrize("name", [*NAMES, *MADE])
def test_no_sequence_makes_a_wrong_move(name: str) -> None:
    for seed in range(QUICK):
        Sequence(name, seed).run()


@pytest.mark.parametrize(
    ("name", "seed", "newer"),
    [
        # a joystick misses a cycle at the end of its tail: the fall was counted from the last frame
        ("gateway-forwarder", 2000807, False),
        # a sensor that shows anything: more was added than a motion may, and no way counted it
        ("canopen-sensor", 2700602, False),
        # a tap of 2 %, a trip and a reload: the rules asked of the axis to know of the tap
        ("j1939-sensor", 2700324, False),
        # a stop with a rest in it: the rules took what moved then for the joystick's
        ("forwarder-robust", 3101022, False),
        # enable released for one frame between two ticks: the next one left with the old velocity
        ("gateway-forwarder", 6500508, True),
    ],
)
def test_what_was_wrong_once_is_right(name: str, seed: int, newer: bool) -> None:
    Sequence(name, seed, newer=newer).run()


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_they_move_and_work_again_behind_the_faults(name: str) -> None:
    seen: Counter[str] = Counter()
    for seed in range(SAMPLE):
        seen += Sequence(name, seed).run()
    assert seen["moves"] > 0.1 * seen["frames"]
    assert seen["ways back"] > 2
    # And where sway sensors are, they were believed, and not always.
    states = {n for n, count in seen.items() if n.startswith("sway sensor") and count > 10}
    if shipped(name).machine.sensors:
        assert {"sway sensor TRUSTED", "sway sensor UNPROVED", "sway sensor JUMP"} <= states


def test_every_shipped_deployment_is_among_them() -> None:
    files = {file.stem for file in CONFIG.glob("*.yaml")}
    assert {*NAMES} == files


def test_every_fault_is_among_them_often() -> None:
    kinds: Counter[str] = Counter()
    for seed in range(80 * len(NAMES)):
        sequence = Sequence(NAMES[seed % len(NAMES)], seed)
        kinds.update(fault.kind for fault in sequence.faults)
    machines = [shipped(name).machine for name in NAMES]
    possible = {kind for one in machines for kind in (*kinds_for(one), *later.kinds_for(one))}
    assert {*ACTS, *LATER, SENDING} <= possible
    assert kinds.keys() == possible
    assert min(kinds[kind] for kind in ACTS) >= 3, kinds


@pytest.mark.parametrize(
    "lie", [pytest.param(lie, marks=pytest.mark.slow) if lie in RARE else lie for lie in LIES]
)
def test_the_rules_catch(lie: str) -> None:
    """Each is one thing wrong; in the same sequence without it nothing is."""
    name, _ = LIES[lie]
    seed = _caught(*LIES[lie])
    Sequence(name, seed).run()


def _caught(name: str, lie: Lie) -> int:
    """The first sequence in which it is seen."""
    for seed in range(MOST):
        sequence = Sequence(name, seed)
        lie(sequence.bench, sequence.machine)
        try:
            sequence.run()
        except Violation:
            return seed
    raise AssertionError("not caught")


@pytest.mark.slow
@pytest.mark.parametrize("method", ["carry_over", "stalled", "send_failed"])
def test_the_rules_catch_what_the_controller_does_not_do(method: str) -> None:
    """A reload that forgets; a standstill, or a frame that was not sent, that does not matter."""
    with patch.object(Controller, method, lambda *_: None):
        seed = _caught("forwarder", lambda *_: None)
    Sequence("forwarder", seed).run()


@pytest.mark.parametrize(
    ("where", "name", "wrong"),
    [
        (FlowBudget, "step", lambda *_: 1.0),  # the pump delivers enough, always
        (FlowBudget, "step", lambda one, flow, *rest: BUDGET(one, 1.2 * flow, *rest)),
        (measured_limits, "bounds", lambda *_: (-1.0, 1.0)),  # no end stop
        (
            measured_limits,
            "bounds",
            lambda *arguments: tuple(-side for side in BOUNDS(*arguments)[::-1]),
        ),
    ],
    ids=["no budget", "budget too large", "no end stop", "wrong end stop"],
)
@pytest.mark.slow
def test_the_rules_catch_a_budget_or_an_end_stop_that_is_none(
    where: Any, name: str, wrong: Any
) -> None:
    with patch.object(where, name, wrong):
        seed = _caught("forwarder-pump", lambda *_: None)
    Sequence("forwarder-pump", seed).run()


def test_a_seed_is_the_same_sequence_every_time() -> None:
    random.seed(1)
    first = Sequence("forwarder", 3)
    second = Sequence("forwarder", 3)
    assert list(map(str, first.faults)) == list(map(str, second.faults))
