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
    """Change of a valve's state by its feedback."""

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
        """Fault that the event counts as; none where the valve follows."""
        return FAULT_OF.get(self.following, FrameFault.NONE)


@dataclass(frozen=True, slots=True)
class MotionEvent:
    """The axes of a two-axis motion move as one again, or each by itself.

    Attributes:
        motion: its name in the file.
        why: what keeps the axes apart: ``radius=lost``, or an axis with its state; empty where
            nothing does.
    """

    motion: str
    why: str

    @property
    def text(self) -> str:
        """Line for the log."""
        return f"motion={self.motion} axes=" + (f"single {self.why}" if self.why else "together")


@dataclass(frozen=True, slots=True)
class ValueEvent:
    """A measured value is known again, lost, or restless: it jumps to and fro.

    Attributes:
        name: ends of an axis, load_state, flow of other functions, hydraulics.
        state: known, lost or restless; of the pump, whether it delivers enough for all axes.
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
    """Change of the measured pendulum length: it differs from the file, or agrees with it again.

    Attributes:
        axis: its name in the file.
        seen: what the sway sensor has shown.
        file: sway data of the axis.
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
    """Gate and codecs disagree about a frame of a joystick."""

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
