"""Events for the log: changes of axes, valves and sensors, and refusals of the gate."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from canshaper.codec.frame import Frame, FrameFault
from canshaper.config.limits import Sway
from canshaper.inputs.value import Following
from canshaper.shaping.states import Transition, Trust
from canshaper.shaping.sway import GRAVITY_M_S2, SwayMode

if TYPE_CHECKING:
    from canshaper.shaping.swing_length import SwingLength

FAULT_OF = {Following.NO: FrameFault.NOT_FOLLOWING, Following.LOST: FrameFault.FEEDBACK_LOST}


@dataclass(frozen=True, slots=True)
class StateEvent:
    """A change of state of an axis."""

    axis: str
    transition: Transition

    @property
    def text(self) -> str:
        """Line for the log."""
        t = self.transition
        text = f"axis={self.axis} state={t.new.name} from={t.old.name} reason={t.reason.name}"
        return f"{text} error={t.error}" if t.error else text


@dataclass(frozen=True, slots=True)
class FeedbackEvent:
    """The feedback of a valve shows another state of the valve.

    Attributes:
        axis: name of the axis.
        following: the new state.
        value: the feedback as a part of full.
        sent: the setpoint as a part of full.
    """

    axis: str
    following: Following
    value: float
    sent: float

    @property
    def text(self) -> str:
        """Line for the log."""
        values = f"feedback_pct={100 * self.value:.0f} command_pct={100 * self.sent:.0f}"
        return f"axis={self.axis} valve={self.following.value} {values}"

    @property
    def fault(self) -> FrameFault:
        """Fault that the event counts as; ``NONE`` where the valve follows."""
        return FAULT_OF.get(self.following, FrameFault.NONE)


@dataclass(frozen=True, slots=True)
class MotionEvent:
    """The axes of a two-axis motion move as one again, or each by itself.

    Attributes:
        motion: name of the motion in the file.
        why: what keeps the axes apart: ``radius=lost``, or an axis and its state, ``slew=TRIPPED``;
            empty where they move as one.
    """

    motion: str
    why: str

    @property
    def text(self) -> str:
        """Line for the log."""
        return f"motion={self.motion} axes=" + (f"single {self.why}" if self.why else "together")


@dataclass(frozen=True, slots=True)
class ValueEvent:
    """A measured value has become known, lost, or restless: it jumps to and fro.

    Attributes:
        name: the value: ends or rope length of an axis, load state, flow of other functions, or
            hydraulics.
        state: known, lost, jumped or restless; for hydraulics, whether the pump delivers enough for
            all axes.
    """

    name: str
    state: str

    @property
    def text(self) -> str:
        """Line for the log."""
        return f"{self.name}={self.state}"


@dataclass(frozen=True, slots=True)
class SwaySensorEvent:
    """Change of the trust state of a sway sensor."""

    axis: str
    trust: Trust

    @property
    def text(self) -> str:
        """Line for the log."""
        return f"axis={self.axis} sway_sensor={self.trust.name}"


@dataclass(frozen=True, slots=True)
class SwingLengthEvent:
    """The measured pendulum length differs from the last reported one, at first from the file's.

    Attributes:
        axis: name of the axis in the file.
        seen: length that the sway sensor has shown.
        file: sway data of the axis, of the file or as changed since.
    """

    axis: str
    seen: "SwingLength"
    file: Sway

    @property
    def text(self) -> str:
        """Line for the log: measured pendulum, value of the file, key to set."""
        seen, mode = self.seen, self.file.mode()
        key, value, says = "length_m", seen.length_m, self.file.length_m
        if says is None:
            as_seen = SwayMode(math.sqrt(GRAVITY_M_S2 / seen.length_m), mode.damping_ratio)
            key, value, says = "period_s", as_seen.period_s, mode.period_s
        return (
            f"axis={self.axis} swings_like_{key}={value:.2f} sd_pct={seen.sd_pct:.0f}"
            f" damping_ratio={seen.damping_ratio:.2f} file={says:.2f}"
            f" set=axes.{self.axis}.sway.{key}={value:.2f}"
        )


def _shown(frame: Frame) -> str:
    """Format a frame for the log."""
    return f"bus={frame.bus} id={frame.can_id:#x} data={frame.data.hex()}"


@dataclass(frozen=True, slots=True)
class DisagreementEvent:
    """Gate and codecs decode different demands from a joystick's frame."""

    frame: Frame
    axis: str

    @property
    def text(self) -> str:
        """Line for the log."""
        return f"decoders=disagree axis={self.axis} {_shown(self.frame)}"


@dataclass(frozen=True, slots=True)
class RefusalEvent:
    """The gate has refused a frame."""

    frame: Frame
    why: str

    @property
    def text(self) -> str:
        """Line for the log."""
        return f"output=refused {_shown(self.frame)} {self.why}"
