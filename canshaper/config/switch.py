"""A switch in a message of its own that has to agree before axes may move."""

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, WithJsonSchema

from canshaper.config.input import Input
from canshaper.config.section import number


class Switch(Input):
    """A switch in a message of its own: seat or door switch, button, state of another ECU."""

    signal: str = Field(description="signal of the switch")
    code: Annotated[int, number(0, 2**32, "", "raw value that agrees; no other one does")] = 1


def _as_list(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


SwitchNames = Annotated[
    list[str],
    BeforeValidator(_as_list),
    Field(min_length=1),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "string"},
                {"type": "array", "items": {"type": "string"}, "minItems": 1},
            ]
        }
    ),
]
"""One name, or several."""
