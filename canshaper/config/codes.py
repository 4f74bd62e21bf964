"""Values of a signal that the DBC names (VAL_), as the deployment file takes them."""

from typing import Literal

from pydantic import Field

from canshaper.config.section import Section

Meaning = Literal["value", "fault"]


class NamedCodes(Section):
    """A signal that is read as a number."""

    codes: dict[str, Meaning] = Field({})
    """By their names, values that the DBC names (VAL_): value for a measurement like every other
    number, fault for none, as without an entry."""
