"""Machines and inputs from which the history of an axis is drawn."""

from dataclasses import dataclass

from hypothesis import strategies as st

from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.states import CommandInput, Reason, State
from canshaper.shaping.sway import SwayMode

BAND = 0.02
LOST = (
    Reason.JOYSTICK_TIMEOUT,
    Reason.JOYSTICK_ERROR,
    Reason.JOYSTICK_NOT_A_NUMBER,
    Reason.SWITCH_INVALID,
)
TRIPS = (Reason.SEND_FAILED, Reason.LOOP_STALLED)
CAUSES = [*(("fault", reason) for reason in LOST), *(("trip", reason) for reason in TRIPS)]
SWITCHES = ("enabled", "bypass", "reset")
WAYS = {
    State.NEUTRAL_WAIT: {State.READY, State.TRIPPED},
    State.READY: {State.NEUTRAL_WAIT, State.ACTIVE, State.BYPASS_ON, State.TRIPPED},
    State.ACTIVE: {State.READY, State.BYPASS_ON, State.STOPPING, State.TRIPPED},
    State.BYPASS_ON: {State.READY, State.ACTIVE, State.STOPPING, State.TRIPPED},
    State.STOPPING: {State.NEUTRAL_WAIT, State.TRIPPED},
    State.TRIPPED: {State.NEUTRAL_WAIT},
}


class Wild:
    """A filter that says what it likes; also no number at all."""

    says = 1.0

    def step(self, command: float) -> float:
        return self.says


@dataclass(frozen=True)
class Setup:
    """A machine: limits, frame, timing and filter."""

    limits: OutputLimits
    filter: str = "gff"
    tick_s: float = 0.05  # a few ticks to full speed: much happens in a short history
    stop_s: float = 0.3
    steps: int = 125
    added: float = 0.0  # largest velocity that a motion may give it


SETUPS = [
    Setup(OutputLimits(tail_s=0.4)),
    Setup(OutputLimits(deadband=0.05, tail_s=0.2, minimum=0.1), tick_s=0.01),
    Setup(OutputLimits(rise_per_s=1.5, fall_per_s=8.0, tail_s=0.4, maximum=0.77)),
    Setup(OutputLimits(rise_per_s=8.0, fall_per_s=1.5, tail_s=0.1), stop_s=1.0),
    Setup(OutputLimits(tail_s=0.4, deadband=0.25), steps=10),
    Setup(OutputLimits(tail_s=0.4, allow_faster=True)),
    Setup(OutputLimits(tail_s=0.4, allow_reverse=True), steps=10),
    Setup(OutputLimits(tail_s=0.3, allow_faster=True, allow_reverse=True, maximum=0.9)),
    Setup(OutputLimits(tail_s=0.0), filter="off"),
    Setup(OutputLimits(tail_s=0.0, rise_per_s=100.0, fall_per_s=100.0), stop_s=0.02),
    Setup(OutputLimits(tail_s=0.4), filter="wild"),
    Setup(OutputLimits(tail_s=0.2, rise_per_s=2.0, deadband=0.05), filter="wild", steps=10),
    Setup(OutputLimits(tail_s=0.2, allow_faster=True, allow_reverse=True), filter="wild"),
    Setup(OutputLimits(tail_s=0.1, rise_per_s=50.0, fall_per_s=4.0), filter="wild", stop_s=0.1),
    Setup(OutputLimits(tail_s=0.4), added=0.3),
    Setup(OutputLimits(tail_s=0.2, deadband=0.05, minimum=0.1), added=0.3),
    Setup(OutputLimits(rise_per_s=1.5, fall_per_s=8.0, tail_s=0.4, maximum=0.77), added=0.3),
    Setup(OutputLimits(rise_per_s=8.0, fall_per_s=1.5, tail_s=0.1), added=0.3),
    Setup(OutputLimits(tail_s=0.3, deadband=0.25), steps=10, added=0.3),
    Setup(OutputLimits(tail_s=0.0, rise_per_s=100.0, fall_per_s=100.0, maximum=0.3), added=0.3),
]
joysticks = st.one_of(
    st.sampled_from([0.0, BAND, -BAND, 0.021, -0.021, 0.3, -0.3, 1.0, -1.0]),
    st.floats(-1.0, 1.0),
)
additions = st.one_of(
    st.sampled_from([0.0, 5e-324, -1e-300, 1e-9, 0.004, -0.004, 0.0041, 0.25, -0.25, 0.5, -0.5]),
    st.floats(-0.5, 0.5),
)
durations = st.sampled_from([1, 2, 3, 5, 10, 20, 40])
modes = st.builds(SwayMode, st.floats(1.0, 6.0), st.floats(0.0, 0.5))
anything = st.builds(
    CommandInput,
    command=joysticks,
    fault=st.none() | st.sampled_from(LOST),
    enabled=st.booleans(),
    bypass=st.booleans(),
    reset=st.booleans(),
    trip=st.none() | st.none() | st.sampled_from(TRIPS),
)
