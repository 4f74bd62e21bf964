"""A message that is taken, as it stands in a deployment file."""

from typing import Annotated

from canshaper.config.protection import Protected
from canshaper.config.section import number


class Input(Protected):
    """A message that is taken, with its age limit and its protection."""

    source: Annotated[int, number(0, 253, "", "source address of the sender, in J1939")] | None = (
        None
    )
    """Source address of the sender, in J1939; by default that of the DBC, where 254 is any."""
    timeout_ms: Annotated[int, number(10, 1000, "ms", "age at which the message counts as lost")]
    alive_max_step: (
        Annotated[
            int, number(1, 255, "", "largest step of the alive counter that is still the next one")
        ]
        | None
    ) = None
    """Largest step of the counter that is still the next one; by default 3, or half its range."""
    qualify: Annotated[
        int, number(1, 20, "messages", "good ones in a row that are needed after a wrong one")
    ] = 1
