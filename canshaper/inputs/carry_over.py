"""What a reload carries over from the controller before to the one that follows it."""

from collections.abc import Hashable, Mapping
from typing import Any, Protocol

Key = tuple[Hashable, ...]


class Part(Protocol):
    """A part of a controller with a state of its own.

    It copies values only: a reference to the part before would keep all of that controller.
    """

    def copy_state(self, before: Any, /) -> None:
        """Take over what the same part of the controller before knew."""


def carry_over(before: Mapping[Key, Part], parts: Mapping[Key, Part]) -> None:
    """Give every part the state of the one with its key; one that is new or another stays new.

    Args:
        before: parts of the controller that ran before, by what they are on the machine.
        parts: those of the one that follows it.
    """
    for key, part in parts.items():
        same = before.get(key)
        if type(same) is type(part):
            part.copy_state(same)
