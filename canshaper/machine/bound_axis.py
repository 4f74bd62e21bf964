"""An axis, bound to the DBC: what its files say, with the codecs of its messages."""

from dataclasses import dataclass

from cantools.database.can import Message

from canshaper.codec.rewrite import RewrittenMessage
from canshaper.codec.status import ReportedAxis, StatusCodec
from canshaper.codec.valve import ValveCodec
from canshaper.config.schema import AxisConfig, RadialConfig
from canshaper.machine.inputs import BoundFeedback, BoundRadius, BoundStatusWord


@dataclass(frozen=True)
class BoundRadial:
    """Radial compensation with the message of its radius, where that is measured."""

    config: RadialConfig
    radius: BoundRadius | None

    @property
    def key(self) -> tuple[str, int, bool] | None:
        """Where the frames of the radius are found."""
        return self.radius.key if self.radius else None


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
    radial: BoundRadial | None = None
    feedback: BoundFeedback | None = None
    status_word: BoundStatusWord | None = None

    @property
    def rewrites(self) -> bool:
        """Whether its command leaves in the frames of its own joystick, through a gateway."""
        return isinstance(self.valve.message, RewrittenMessage)
