"""Trust in a joystick's frames: sequence, silence, and an enable seen released."""

from typing import Any

import pytest

from canshaper.codec.frame import Frame, FrameFault
from canshaper.shaping.states import State
from tests.rigs.forwarder import SLOW_VALVE, Make, Rig, command, last_fault, velocity

# timeout_ms of the shipped joysticks, 100 ms: the last frame counts in so many ticks after its own.
FRESH_TICKS = 5
LEFT = "    alive_counter: AliveCounter\n  right:"


def feed(rig: Rig, *frames: Frame) -> dict[str, dict[str, Any]]:
    """These frames of the left joystick, a good one of the right, and a tick."""
    rig.receive(*frames, rig.joystick("JoystickRight"))
    return rig.tick()


def skip(rig: Rig, counts: int) -> None:
    """The left joystick's counter runs on unseen; the next frame is ``counts`` + 1 after it."""
    rig.counts["JoystickLeft"] += counts


# -- sequence --------------------------------------------------------------------------------------


@pytest.mark.parametrize("silence", [0, 1, 4, 5, 6, 7, 20])
def test_a_frozen_counter_never_counts_again_however_long_it_was_silent(
    rig: Rig, silence: int
) -> None:
    """A gateway that repeats its last frame for ever, with pauses: its joystick is gone."""
    rig.run(5)
    frozen = rig.joystick()
    for _ in range(3):
        for _ in range(15):
            feed(rig, frozen)
        assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "JOYSTICK_UNTRUSTED")
        for _ in range(silence):
            feed(rig)
            assert rig.state() is State.NEUTRAL_WAIT
    feed(rig, rig.joystick())
    assert rig.state() is State.READY


def test_a_frozen_counter_stops_what_moves_through_the_filter(rig: Rig) -> None:
    rig.moving()
    frozen = rig.joystick(Slew=1000)
    feed(rig, frozen)
    for _ in range(FRESH_TICKS):
        assert velocity(feed(rig, frozen)) > 50
        assert rig.state() is State.ACTIVE
    assert velocity(feed(rig, frozen)) > 50
    assert (rig.state(), rig.reason()) == (State.STOPPING, "JOYSTICK_UNTRUSTED")
    assert last_fault(rig) is FrameFault.COUNTER_REPEATED
    assert rig.count("InvalidSignals") == FRESH_TICKS + 1


@pytest.mark.parametrize("counter", [0, 3, 77, 255])
def test_a_joystick_that_was_switched_off_may_begin_with_any_counter(
    rig: Rig, counter: int
) -> None:
    rig.run(5)
    for _ in range(FRESH_TICKS + 1):
        feed(rig)
    assert rig.reason() == "JOYSTICK_TIMEOUT"
    rig.counts["JoystickLeft"] = counter - 1
    feed(rig, rig.joystick())
    assert rig.state() is State.READY
    assert rig.count("InvalidSignals") == 0
    feed(rig, rig.joystick())
    assert rig.state() is State.READY


def test_silence_until_the_timeout_is_none(rig: Rig) -> None:
    rig.moving()
    for _ in range(FRESH_TICKS - 1):
        feed(rig)
    skip(rig, 100)
    feed(rig, rig.joystick(Slew=200))
    assert last_fault(rig) is FrameFault.COUNTER_JUMP
    assert command(rig) == 1.0


def test_without_a_counter_every_frame_counts(changed_rig: Make) -> None:
    rig = changed_rig({LEFT: "  right:"})
    rig.moving()
    for raw in (400, 400, 200):
        feed(rig, rig.joystick(Slew=raw, AliveCounter=7))
        assert command(rig) == pytest.approx(raw / 1000)
    assert rig.count("InvalidSignals") == 0


def test_a_jump_without_silence_is_refused_and_the_next_frame_counts(rig: Rig) -> None:
    rig.moving()
    skip(rig, 3)
    feed(rig, rig.joystick(Slew=0))
    assert command(rig) == 1.0
    assert rig.state() is State.ACTIVE
    assert (rig.count("InvalidSignals"), last_fault(rig)) == (1, FrameFault.COUNTER_JUMP)
    feed(rig, rig.joystick(Slew=200))
    assert command(rig) == pytest.approx(0.2)
    assert rig.count("InvalidSignals") == 1


@pytest.mark.parametrize("lost", [1, 2])
def test_a_few_lost_frames_are_no_jump(rig: Rig, lost: int) -> None:
    rig.moving()
    for _ in range(lost):
        rig.joystick()
        feed(rig)
    feed(rig, rig.joystick(Slew=200))
    assert command(rig) == pytest.approx(0.2)
    assert rig.count("InvalidSignals") == 0


def test_jumps_without_end_are_no_joystick(rig: Rig) -> None:
    """Two senders of one id, each with a counter of its own."""
    rig.moving()
    for tick in range(FRESH_TICKS + 2):
        rig.counts["JoystickLeft"] = 100 * (tick % 2) + tick
        feed(rig, rig.joystick(Slew=1000))
    assert (rig.state(), rig.reason()) == (State.STOPPING, "JOYSTICK_UNTRUSTED")


@pytest.mark.parametrize("qualify", [2, 5])
def test_so_many_good_frames_are_needed_after_a_wrong_one(changed_rig: Make, qualify: int) -> None:
    rig = changed_rig({LEFT: LEFT.replace("\n  right", f"\n    qualify: {qualify}\n  right")})
    for _ in range(qualify - 1):
        feed(rig, rig.joystick())
        assert rig.state() is State.NEUTRAL_WAIT
    feed(rig, rig.joystick())
    assert rig.state() is State.READY
    feed(rig, rig.joystick(Slew=1000))
    assert command(rig) == 1.0
    skip(rig, 10)
    for _ in range(qualify):
        feed(rig, rig.joystick(Slew=200))
        assert command(rig) == 1.0
    feed(rig, rig.joystick(Slew=200))
    assert command(rig) == pytest.approx(0.2)


@pytest.mark.parametrize("silent", [True, False])
def test_silence_is_not_distrust(rig: Rig, silent: bool) -> None:
    """The reason says where to look: nothing comes, or what comes is wrong."""
    rig.run(5)
    frozen = rig.joystick()
    for _ in range(FRESH_TICKS + 2):
        if silent:
            feed(rig)
        else:
            feed(rig, frozen)
    for _ in range(FRESH_TICKS):
        assert rig.reason() == ("JOYSTICK_TIMEOUT" if silent else "JOYSTICK_UNTRUSTED")
        feed(rig)
    assert rig.reason() == ("JOYSTICK_TIMEOUT" if silent else "JOYSTICK_UNTRUSTED")
    feed(rig)  # what was refused is forgotten as what was accepted is
    assert rig.reason() == "JOYSTICK_TIMEOUT"


# -- an enable seen released -----------------------------------------------------------------------


@pytest.mark.parametrize("wrong", ["repeated", "jump"])
def test_a_released_enable_in_a_frame_out_of_sequence_stops_at_once(rig: Rig, wrong: str) -> None:
    rig.moving()
    skip(rig, -1 if wrong == "repeated" else 100)
    sent = feed(rig, rig.joystick(Slew=1000, Enable=0))
    assert velocity(sent) == 0
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "ENABLE_LOST")
    for _ in range(20):  # frozen: nothing in it counts
        sent = feed(rig, rig.joystick(Slew=1000, Enable=1, AliveCounter=rig.counts["JoystickLeft"]))
        skip(rig, -1)
        assert velocity(sent) == 0
    assert rig.state() is State.TRIPPED


@pytest.mark.parametrize("qualify", [2, 5, 20])
def test_a_released_enable_needs_no_qualification(changed_rig: Make, qualify: int) -> None:
    rig = changed_rig({LEFT: LEFT.replace("\n  right", f"\n    qualify: {qualify}\n  right")})
    rig.run(qualify)
    rig.moving()
    skip(rig, 10)
    feed(rig, rig.joystick(Slew=1000))  # refused; from here on all is well again
    assert rig.state() is State.ACTIVE
    assert velocity(feed(rig, rig.joystick(Slew=1000, Enable=0))) == 0
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "ENABLE_LOST")


@pytest.mark.parametrize("slow", [{}, SLOW_VALVE])
@pytest.mark.parametrize("silent", [False, True])
def test_a_short_release_is_a_release(
    changed_rig: Make, slow: dict[str, str], silent: bool
) -> None:
    """Off and on again before the next tick, or before the next frame of a slow valve.

    Nor does it matter that the joystick falls silent after it.
    """
    rig = changed_rig(dbc=slow)
    rig.run(30)
    rig.run(61, Slew=1000)
    assert rig.state() is State.ACTIVE
    rig.receive(rig.joystick(Slew=1000, Enable=0))
    for _ in range(10):
        if silent:
            feed(rig)
        else:
            feed(rig, rig.joystick(Slew=1000))
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "ENABLE_LOST")


def test_only_off_is_released(rig: Rig) -> None:
    """An error code out of sequence is no news: it neither stops nor enables."""
    rig.moving()
    number = rig.counts["JoystickLeft"]
    for enable in (1, 2, 3):
        feed(rig, rig.joystick(Slew=1000, AliveCounter=number, Enable=enable))
        assert rig.state() is State.ACTIVE
