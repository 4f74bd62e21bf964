"""Wrong outputs that go on after a reason to stop, at once or shaped."""

import pytest

from tests.gate.kinds import (
    COUNTED,
    NAMES,
    STOPPED,
    Kind,
    again,
    counter,
    down,
    drop,
    enable_code,
    failed,
    flag,
    flags,
    gap,
    goes_no_farther,
    held,
    raw,
    sender,
    spoilt,
    stalled,
    twin,
    up,
)

pytestmark = pytest.mark.slow

KINDS = {
    # reasons to stop at once, in motion
    "enable released": Kind(held, flag(enable=0), before=40),
    "enable released, ramp down": Kind(down, flag(enable=0), before=40),
    "enable released for a tick": Kind(held, again(0, 0, 1), before=40),
    "enable released for a second": Kind(held, again(0, 0, 50), before=40, ticks=120),
    "second sender": Kind(held, sender(0, 1), before=40, ticks=120),
    "second sender goes on": Kind(
        held,
        sender(0, 999),
        before=40,
    ),
    "failed send": Kind(held, failed, before=40, ticks=120),
    "loop stalled": Kind(held, stalled, before=40, ticks=120, bound=0.0),
    "loop late by 0.3 s": Kind(
        held, gap, before=40, bound=0.7, why="asked all the time; it is the loop that says so"
    ),
    "emergency stop": Kind(held, flag(stop=1), before=40, only=("remote-forwarder",)),
    "emergency stop for a tick": Kind(
        held, again(1, 0, 1, "stop", 0), before=40, ticks=120, only=("remote-forwarder",)
    ),
    "emergency stop in error": Kind(held, flag(stop=2), before=40, only=("remote-forwarder",)),
    # reasons to stop shaped
    "silence, then no frames": Kind(held, drop(), before=60, ticks=20, bound=0.4, why="stop_s"),
    "silence": Kind(held, drop(), before=60, ticks=250, bound=STOPPED, why="stop_s"),
    "silence, then held again": Kind(
        lambda k, was: was if k > 200 else 0.0,
        drop(0, 30),
        before=40,
        ticks=260,
        bound=0.06,
        why="a gateway without frames: the last one holds",
    ),
    "silence, then at once again": Kind(
        held, drop(0, 20), before=60, ticks=300, bound=STOPPED, why="stop_s"
    ),
    "enable in error": Kind(
        held, enable_code(2), before=60, ticks=250, bound=STOPPED, why="stop_s"
    ),
    "enable not available": Kind(
        held, enable_code(3), before=60, ticks=250, bound=STOPPED, why="stop_s"
    ),
    "enable in error at rest": Kind(up, enable_code(2)),
    "counter stands": Kind(
        held, counter(lambda k: 7), before=60, ticks=250, bound=STOPPED, why="stop_s", only=COUNTED
    ),
    "counter jumps": Kind(
        held,
        counter(lambda k: 5 * k),
        before=60,
        ticks=250,
        bound=STOPPED,
        why="stop_s",
        only=COUNTED,
    ),
    "wrong length": Kind(
        held,
        spoilt(lambda w, f: [f._replace(data=f.data[:-1])]),
        before=60,
        ticks=250,
        bound=STOPPED,
        why="stop_s",
    ),
    "beyond the range": Kind(
        held,
        raw(lambda w, n: 1010 if n == "10" else 245 if n == "8" else -32768),
        before=60,
        ticks=250,
        bound=STOPPED,
        why="stop_s",
    ),
    "code Error": Kind(
        held,
        raw(lambda w, n: {"10": 1022, "8": 254}.get(n, 32766)),
        before=60,
        ticks=250,
        bound=STOPPED,
        why="stop_s",
        only=(*COUNTED, "j1939-forwarder"),
    ),
    "code NotAvailable at rest": Kind(
        up,
        raw(lambda w, n: {"10": 1023, "8": 255}.get(n, 32767)),
        only=(*COUNTED, "j1939-forwarder"),
    ),
    "flags contradict": Kind(
        held,
        flags(0, 1, 1),
        before=60,
        ticks=250,
        bound=STOPPED,
        why="stop_s",
        only=("j1939-forwarder",),
    ),
    "flags neutral, deflected": Kind(up, flags(1, 0, 1), only=("j1939-forwarder",)),
    # frames that are not the joystick's
    "twins say full": Kind(up, spoilt(twin)),
}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("what", KINDS)
def test_goes_no_farther(what: str, name: str) -> None:
    goes_no_farther(name, KINDS[what])
