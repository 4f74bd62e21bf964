"""What the guard believes of joysticks and emergency stop, and for how long."""

import random
from dataclasses import replace

import pytest

from canshaper.codec.frame import Frame
from canshaper.guard import inputs
from canshaper.guard.bits import MOST_KNOWN
from canshaper.guard.inputs import MOST_UNREAD
from canshaper.guard.output import OutputGuard
from canshaper.machine.binding import load_deployment
from tests.faults import shipped, variants
from tests.guard.bench import Bench
from tests.rigs.j1939 import OWN, bjm


def bench(name: str = "forwarder", axis: str = "near_far") -> Bench:
    return Bench(load_deployment(shipped.CONFIG / f"{name}.yaml"), axis)


def test_a_joystick_that_is_silent_holds_for_its_timeout_and_stop() -> None:
    one = bench()
    one.ramp(125, near_far=1.0)
    held = [one.sent(125) for _ in range(200)]
    # timeout_ms, stop_s, the longest standstill and three periods
    ends = (100 + 2000 + 100 + 60) // 20
    assert not any(held[:ends])
    assert "limit=silence" in held[ends]


def test_a_joystick_that_drives_nothing_is_received_too() -> None:
    deployment = load_deployment(shipped.CONFIG / "forwarder.yaml")
    axes = {name: axis for name, axis in deployment.axes.items() if name != "lift"}
    one = Bench(replace(deployment, axes=axes), "near_far")
    one.receive(one.joysticks(near_far=0.5))
    one.receive(one.joysticks(enable=False))
    assert [joystick.released for joystick in one.guard._joysticks] == [True, True]


@pytest.mark.parametrize("spoil", [slice(0, 7), slice(0, 6)])
def test_a_frame_of_a_wrong_length_is_none(spoil: slice) -> None:
    one = bench()
    one.receive([frame._replace(data=frame.data[spoil]) for frame in one.joysticks(near_far=1.0)])
    assert "limit=silence" in one.sent(10)


def test_a_frame_with_a_wrong_checksum_is_none() -> None:
    one = Bench(variants.machine("protected")[1], "near_far")
    spoilt = [f._replace(data=bytes([f.data[0] ^ 1, *f.data[1:]])) for f in one.joysticks()]
    one.receive(spoilt)
    assert {entry.received_ns for entry in one.guard.inputs.values()} == {-(10**18)}
    one.receive(one.joysticks())
    assert {entry.received_ns for entry in one.guard.inputs.values()} == {0}


def test_an_emergency_stop_is_pressed_missing_or_free() -> None:
    one = Bench(variants.machine("protected")[1], "near_far")
    for _ in range(5):
        assert not one.sends(0)
    assert not one.sends(10, near_far=1.0)
    stop = one.deployment.emergency_stop
    assert stop is not None
    entry = one.guard.inputs[stop.key]
    short = [frame for frame in one.joysticks(near_far=1.0) if frame[:3] != stop.key]
    for _ in range(one.deployment.config.joysticks["left"].timeout_ms // 20):
        one.receive(short)
        assert not one.sent(10)
    received_ns = entry.received_ns
    while one.now_ns <= received_ns + stop.config.timeout_ms * 1_000_000:
        one.receive(short)
        assert not one.sent(10)
    assert "limit=emergency-stop" in one.sent(10)


def test_after_a_standstill_no_command_from_before_holds() -> None:
    one = bench()
    one.ramp(60, near_far=1.0)
    one.guard.stalled()
    assert "limit=" in one.sent(60)
    assert not one.sends(60, near_far=1.0)


def test_enable_released_and_held_again() -> None:
    one = bench()
    one.ramp(60, near_far=1.0)
    one.receive(one.joysticks(enable=False, near_far=1.0))
    assert "limit=enable" in one.sent(60)
    assert not one.sends(60, near_far=1.0)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_command_in_a_direction_holds_for_the_tail(sign: int) -> None:
    one = bench()
    one.ramp(sign * 60, near_far=sign * 0.5)
    for size in (0.4, 0.3, 0.45, 0.1):  # the largest counts, whatever came later
        assert not one.sends(sign * 60, near_far=sign * size)
    assert not one.sends(sign * 60)
    held = [one.sends(sign * 60) for _ in range(150)]
    # tail_s, timeout_ms, the longest standstill and three periods, from the last frame that
    # commanded it on, six ticks before; with the next tick they are over.
    assert [bool(why) for why in held].index(True) == (2000 + 100 + 100 + 60) // 20 - 6 + 1


@pytest.mark.parametrize("axis", ["slew", "near_far"])
@pytest.mark.parametrize("seed", range(4))
def test_frames_read_together_say_what_each_alone_does(
    monkeypatch: pytest.MonkeyPatch, seed: int, axis: str
) -> None:
    benches = [bench("forwarder-robust", axis) for _ in range(2)]
    rng, said = random.Random(seed), set()
    for turn in range(400):
        commands = {name: rng.uniform(-1, 1) for name in ("slew", "near_far") if rng.random() < 0.7}
        looks, steps = turn % 40 > 20 + seed, rng.randrange(-30, 31)
        enable = rng.random() < 0.95
        whys = []
        for one, most in zip(benches, (MOST_UNREAD, 1), strict=True):
            monkeypatch.setattr(inputs, "MOST_UNREAD", most)
            one.receive(one.joysticks(enable=enable, **commands))
            whys.append(one.sent(steps if looks else 0))
        assert whys[0] == whys[1], turn
        said.add(whys[0] == "")
        for joystick in benches[0].guard._joysticks:
            assert len(joystick._unread) < MOST_UNREAD
    assert said == {False, True}


@pytest.mark.parametrize(("steps", "passes"), [(38, True), (39, False)])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_rates_hold_for_a_command(sign: int, steps: int, passes: bool) -> None:
    one = bench()
    one.ramp(sign * 25, near_far=float(sign))  # 0.158 of full speed; the rise is 0.1 in a tick
    assert ("limit=rate" in one.sends(sign * steps, near_far=float(sign))) is not passes


def test_faster_and_the_other_way_where_the_file_allows_it() -> None:
    one = Bench(variants.machine("allowing")[1], "near_far")
    one.ramp(125, near_far=0.2)
    assert not one.sends(60, near_far=0.2)
    for steps in (30, 0, -15, -25):
        assert not one.sends(steps, near_far=0.2)
    for _ in range(60):
        one.sends(0)
    assert "limit=asked" in one.sends(10)


def test_what_is_kept_of_commands_is_bounded() -> None:
    one = bench("canopen-forwarder", "slew")
    valve = one.guard.valves[one.valve.message.key]
    axes, most = getattr(valve, "_axes", [valve]), 0
    for steps in range(1, MOST_KNOWN + 12):
        assert "limit=" in one.sent(steps)
        most = max(most, *(len(axis._commands) for axis in axes))
    assert most == MOST_KNOWN


class TestSources:
    """J1939: the first joystick that comes counts, until it is silent."""

    def guard(self) -> OutputGuard:
        return OutputGuard(load_deployment(shipped.CONFIG / "j1939-forwarder.yaml"))

    def commanded(self, guard: OutputGuard) -> set[float]:
        for one in guard._joysticks:
            one.read()
        return {axis.now for one in guard._joysticks for _, _, axis in one._axes}

    def test_another_one_counts_after_its_silence(self) -> None:
        guard = self.guard()
        timeout_ns = guard._joysticks[0].timeout_ns
        guard.note(bjm(X=50.0), 0)
        guard.note(bjm("BJM1", 0x34, X=-70.0), timeout_ns)
        assert 0.5 in self.commanded(guard)
        assert -0.7 not in self.commanded(guard)
        guard.note(bjm("BJM1", 0x34, X=-70.0), timeout_ns + 1)
        assert -0.7 in self.commanded(guard)
        guard.note(bjm("BJM1", 0x33, X=50.0), timeout_ns + 2)
        assert 0.5 not in self.commanded(guard)

    def test_neither_our_own_nor_another_message_counts(self) -> None:
        guard = self.guard()
        guard.note(bjm("BJM1", OWN, X=50.0), 0)
        guard.note(Frame("crane", 0x18FF0033, True, bytes(8)), 0)
        guard.note(bjm(X=50.0)._replace(extended=False), 0)
        assert self.commanded(guard) == {0.0}
