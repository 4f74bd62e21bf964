"""An axis, bound to the DBC: what its files say, with the codecs of its messages."""

from dataclasses import dataclass

from cantools.database.can import Message

from canshaper.codec.rewrite import RewrittenMessage
from canshaper.codec.status import ReportedAxis, StatusCodec
from canshaper.codec.valve import ValveCodec
from canshaper.config.schema import AxisConfig, Feedback, StatusWord
from canshaper.machine.inputs import Bound, BoundValue
from canshaper.machine.sway_sensor import BoundSwaySensor


@dataclass(frozen=True)
class BoundAxis:
    """An axis with its valve message and, where it has one, its status message."""

    name: str
    config: AxisConfig
    valve_message: Message
    valve: ValveCodec
    period_ticks: int
    status: StatusCodec[ReportedAxis] | None
    status_ticks: int
    feedback: BoundValue[Feedback] | None = None
    status_word: Bound[StatusWord] | None = None
    sway_sensor: BoundSwaySensor | None = None

    @property
    def rewrites(self) -> bool:
        """Whether its command leaves in the frames of its own joystick, through a gateway."""
        return isinstance(self.valve.message, RewrittenMessage)
