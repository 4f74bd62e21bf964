"""Ticks that follow a joystick: how soon they are there, how steady, and what moves them."""

import random
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from canshaper.controller.controller import Controller
from canshaper.daemon.follow import AFTER_NS, CLUSTER_NS, TickFollower, tick_follower
from canshaper.machine.binding import load_deployment
from tests.rigs.files import machine_file

MS = 1_000_000
PERIOD_NS = 20 * MS
MOST_NS = 200_000  # 1 % of it


class Joysticks:
    """Times of the last good frames of joysticks in the controller; the first one is followed."""

    def __init__(self, cycle_ms: int = 20, others: int = 0) -> None:
        names = ["left", *(f"other {n}" for n in range(others))]
        self.left, *self.others = (SimpleNamespace(received_ns=None) for _ in names)
        controller: Any = SimpleNamespace(
            joysticks=dict(zip(names, [self.left, *self.others], strict=True))
        )
        joystick = SimpleNamespace(message=SimpleNamespace(cycle_time=cycle_ms))
        config = SimpleNamespace(tick=SimpleNamespace(follow="left"), tick_ms=20)
        deployment: Any = SimpleNamespace(config=config, joysticks=dict.fromkeys(names, joystick))
        self.follower = TickFollower(deployment, controller)

    def waits(
        self,
        ticks: int,
        *,
        jitter_ns: int = 0,
        begin_ns: int = 10**12 + 7 * MS,
        joystick_ns: int = PERIOD_NS,
        lost: float = 0.0,
    ) -> tuple[list[int], list[int]]:
        """From the left frame to the tick that reads it, and from tick to tick."""
        noise = random.Random(3)
        deadline = before = 10**12
        came = begin_ns
        waits, apart = [], []
        for _ in range(ticks):
            while (at := came + noise.randint(0, jitter_ns)) <= deadline:
                if noise.random() >= lost:
                    waits.append(deadline - at)
                    self.left.received_ns = at
                came += joystick_ns
            apart.append(deadline - before)
            before = deadline
            deadline += PERIOD_NS
            deadline += self.follower(deadline)
        return waits, apart[1:]


@pytest.fixture
def joysticks() -> Joysticks:
    return Joysticks()


@pytest.mark.parametrize("phase_ms", range(0, 20, 3))
def test_within_a_second_a_frame_waits_no_longer_than_it_has_to(
    joysticks: Joysticks, phase_ms: int
) -> None:
    waits, apart = joysticks.waits(200, begin_ns=10**12 + phase_ms * MS)
    assert set(waits[60:]) == {AFTER_NS}
    assert max(abs(ns - PERIOD_NS) for ns in apart) <= MOST_NS


@pytest.mark.parametrize("drift_ns", [-20_000, 20_000])
def test_a_joystick_with_another_clock_is_followed(joysticks: Joysticks, drift_ns: int) -> None:
    waits, _ = joysticks.waits(2000, joystick_ns=PERIOD_NS + drift_ns)
    assert all(abs(ns - AFTER_NS) <= 2 * abs(drift_ns) for ns in waits[100:])


@pytest.mark.parametrize("part", [0.98, 1.02, 1.5])
def test_a_joystick_with_another_cycle_is_not_followed(joysticks: Joysticks, part: float) -> None:
    _, apart = joysticks.waits(300, joystick_ns=round(part * PERIOD_NS))
    assert set(apart[120:]) == {PERIOD_NS}
    assert not joysticks.follower.follows
    assert joysticks.follower.news().startswith("tick=plain joystick=left cycle_ms=")
    assert not joysticks.follower.news(), "once"
    waits, _ = joysticks.waits(300)
    assert joysticks.follower.news() == "tick=follows joystick=left cycle_ms=20.00 expected=20"
    assert set(waits[200:]) == {AFTER_NS}


@pytest.mark.parametrize("part", [0.995, 1.005])
def test_lost_frames_do_not_look_like_another_cycle(joysticks: Joysticks, part: float) -> None:
    waits, _ = joysticks.waits(600, joystick_ns=round(part * PERIOD_NS), lost=0.3)
    assert joysticks.follower.follows and not joysticks.follower.news()
    assert all(abs(ns - AFTER_NS) < 2 * MS for ns in waits[200:])


def test_a_joystick_that_is_not_steady_is_read_in_its_tick(joysticks: Joysticks) -> None:
    waits, apart = joysticks.waits(2000, jitter_ns=600_000)
    assert max(waits[100:]) < 2 * MS
    assert max(abs(ns - PERIOD_NS) for ns in apart) <= MOST_NS


def test_without_a_frame_the_deadlines_stay_where_they_are(joysticks: Joysticks) -> None:
    assert joysticks.follower(10**12) == 0
    joysticks.left.received_ns = 10**12
    assert joysticks.follower(10**12 + PERIOD_NS) == MOST_NS
    assert joysticks.follower(10**12 + 2 * PERIOD_NS) == 0, "the same frame counts once"
    joysticks.left.received_ns = None
    assert joysticks.follower(10**12 + 3 * PERIOD_NS) == 0


def test_where_the_command_line_takes_another_interface_the_ticks_stay(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("WARNING", "canshaper")
    follow = ("buses:\n", "tick: { follow: left }\nbuses:\n")
    deployment = load_deployment(machine_file(tmp_path, "forwarder", follow))
    assert tick_follower(deployment, Controller(deployment)) is not None
    buses = {
        n: b.model_copy(update={"interface": "virtual"}) for n, b in deployment.config.buses.items()
    }
    config = deployment.config.model_copy(update={"buses": buses})
    changed = replace(deployment, config=config)
    assert tick_follower(changed, Controller(changed)) is None
    (record,) = caplog.records
    assert record.message.startswith("tick=plain expected a bus of socketcan")


def step(cycle_ms: int, *others_ns: int, deadline_ns: int) -> int:
    """How much later the deadline shall be, with a frame of the followed joystick at 40 ms."""
    joysticks = Joysticks(cycle_ms, len(others_ns))
    for one, at_ns in zip([joysticks.left, *joysticks.others], (40 * MS, *others_ns), strict=True):
        one.received_ns = at_ns
    return joysticks.follower(deadline_ns)


@pytest.mark.parametrize("ticks", [0, 1, 2, 3])
def test_a_joystick_every_second_tick_is_followed_by_both(ticks: int) -> None:
    at = 40 * MS + AFTER_NS + ticks * PERIOD_NS
    assert step(40, deadline_ns=at + 50_000) == -50_000
    assert step(40, deadline_ns=at - 50_000) == 50_000


def test_the_nearest_of_two_frames_in_a_tick_is_followed() -> None:
    assert step(10, deadline_ns=50 * MS + AFTER_NS + 50_000) == -50_000


HALF, FAR = CLUSTER_NS // 2, CLUSTER_NS * 6 // 5


@pytest.mark.parametrize(
    ("others", "last"),
    [
        ([0], 0),
        ([HALF], HALF),
        ([CLUSTER_NS], CLUSTER_NS),
        ([CLUSTER_NS + 1], 0),
        ([-HALF], 0),
        ([10 * MS], 0),
        ([HALF - PERIOD_NS], HALF),
        ([HALF, FAR], FAR),  # each is near the one before
    ],
)
def test_of_several_joysticks_the_last_of_the_first_cluster_counts(
    others: list[int], last: int
) -> None:
    at = 40 * MS + last + AFTER_NS
    assert step(20, *(40 * MS + one for one in others), deadline_ns=at + 50_000) == -50_000
