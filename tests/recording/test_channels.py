"""Channels of a log and buses of a deployment."""

from dataclasses import replace
from itertools import pairwise

import pytest

from canshaper.cli.common import loader
from canshaper.codec.frame import Frame
from canshaper.errors import LogError
from canshaper.machine.deployment import Deployment
from canshaper.recording.channels import Kind, Sorter, bus_of_channel
from canshaper.recording.ticks import LEAD_NS, PAUSE_NS, clocked


@pytest.fixture(scope="module")
def one() -> Deployment:
    return loader("forwarder.yaml")()


@pytest.fixture(scope="module")
def two(one: Deployment) -> Deployment:
    crane = one.config.buses["crane"]
    buses = {"crane": crane, "joy": crane.model_copy(update={"channel": "can1"})}
    return replace(one, config=one.config.model_copy(update={"buses": buses}))


def test_the_deployments_own_channel_counts(one: Deployment, two: Deployment) -> None:
    assert bus_of_channel(one, {"can3", "vcan0"}, {}) == {"vcan0": "crane"}
    assert bus_of_channel(two, {"can1", "vcan0"}, {}) == {"vcan0": "crane", "can1": "joy"}


def test_then_the_name_of_the_bus_then_the_only_one(one: Deployment) -> None:
    assert bus_of_channel(one, {"can3", "crane"}, {}) == {"crane": "crane"}
    assert bus_of_channel(one, {"can3"}, {}) == {"can3": "crane"}
    assert bus_of_channel(one, {""}, {}) == {"": "crane"}


def test_what_the_command_line_says_goes_first(one: Deployment, two: Deployment) -> None:
    assert bus_of_channel(one, {"can3", "vcan0"}, {"crane": "can3"}) == {"can3": "crane"}
    assert bus_of_channel(two, {"1", "2"}, {"crane": "2", "joy": "1"}) == {"2": "crane", "1": "joy"}


def test_a_bus_without_a_channel_is_reported_with_what_there_is(
    one: Deployment, two: Deployment
) -> None:
    with pytest.raises(
        LogError, match="bus crane: expected the channel 'vcan0', got 'can3', 'can4' in the log"
    ):
        bus_of_channel(one, {"can3", "can4"}, {})
    with pytest.raises(
        LogError,
        match=r"expected the channel 'can9', got .*; choose one .* --channel crane=CHANNEL",
    ):
        bus_of_channel(one, {"can3"}, {"crane": "can9"})
    with pytest.raises(
        LogError, match="expected a channel of its own, got 'can3', that of bus crane"
    ):
        bus_of_channel(two, {"can3"}, {"crane": "can3", "joy": "can3"})


def test_what_a_frame_is_to_the_daemon(one: Deployment) -> None:
    sorter = Sorter(one)
    kinds = {
        0x110: Kind.RECEIVED,  # a joystick
        0x200: Kind.SENT,  # a valve
        0x300: Kind.SENT,  # a status
        0x310: Kind.SENT,
        0x400: Kind.IGNORED,  # known to the DBC file, and nothing to the daemon
        0x123: Kind.OTHER,  # unknown: read when the valves have their frames
    }
    assert {i: sorter.kind(("crane", i, False)) for i in kinds} == kinds
    assert sorter.kind(("crane", 0x110, True)) is Kind.OTHER


def test_other_interfaces_than_socketcan_have_one_queue(one: Deployment) -> None:
    bus = one.config.buses["crane"].model_copy(update={"interface": "udp_multicast"})
    config = one.config.model_copy(update={"buses": {"crane": bus}})
    assert Sorter(replace(one, config=config)).kind(("crane", 0x123, False)) is Kind.RECEIVED


def test_a_pause_costs_no_tick_for_each_of_its_deadlines() -> None:
    """Its first seconds do, in which what moves stops, and the last one before the next frame."""
    tick_ns, day_ns = 20_000_000, 24 * 3600 * 10**9
    frame = Frame("crane", 0x110, False, b"\0" * 8)
    times = [0, 5_000_000, day_ns, day_ns + 100_000_000, 400 * day_ns]
    ticks = list(clocked([(at, frame, Kind.RECEIVED) for at in times], tick_ns))
    assert [tick.number for tick in ticks] == list(range(len(ticks)))
    assert len(ticks) < 3 * (PAUSE_NS + LEAD_NS) // tick_ns
    assert {(tick.now_ns - ticks[0].now_ns) % tick_ns for tick in ticks} == {0}
    received = [(at, tick.now_ns) for tick in ticks for at, _ in tick.received]
    assert [at for at, _ in received] == times
    assert all(0 <= now_ns - at < tick_ns for at, now_ns in received)
    steps = [after.now_ns - before.now_ns for before, after in pairwise(ticks)]
    assert sum(step > tick_ns for step in steps) == 2
    before = [tick.now_ns for tick in ticks if tick.now_ns < day_ns - 2 * LEAD_NS]
    assert before[-1] >= PAUSE_NS
    begin_again = next(t.now_ns for t in ticks if t.now_ns > before[-1])
    assert LEAD_NS - tick_ns <= day_ns - begin_again <= LEAD_NS + tick_ns
