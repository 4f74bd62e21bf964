"""A message that is received, as it stands in a deployment file."""

from typing import Annotated

from canshaper.config.protection import Protected
from canshaper.config.section import number


class Input(Protected):
    """A message that is received, with its age limit and its protection."""

    source: Annotated[int, number(0, 253, "", "source address of the sender, in J1939")] | None = (
        None
    )
    """J1939: address of the sender; by default that of the DBC, where FE (254) is any."""
    timeout_ms: Annotated[int, number(10, 1000, "ms", "age at which the message counts as lost")]
    """Age at which it is lost; of a joystick at least two cycles and two ticks."""
    alive_max_step: (
        Annotated[
            int, number(1, 255, "", "largest step of the alive counter that is still the next one")
        ]
        | None
    ) = None
    """Largest step that still counts as the next message, at most half of the counter's range; by
    default 3, 1 and 2 for counters of one and two bits."""
    qualify: Annotated[int, number(1, 20, "messages", "good ones in a row that are needed")] = 1
    """Good messages in a row that are needed at the start, after a wrong one and after silence."""
