"""Where measured numbers of a deployment file come from, as it stands next to them."""

from collections.abc import Iterator
from datetime import UTC, date, datetime
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from canshaper.config.section import Section, sections
from canshaper.config.source import Place
from canshaper.errors import printable
from canshaper.shipped import version


class Origin(Section):
    """Where numbers come from; written with them."""

    date: str = Field(
        description="day on which they were written", json_schema_extra={"format": "date"}
    )
    log: str | None = Field(
        None, description="what they were computed from: name of the log, stopwatch"
    )
    by: str = Field(description="verb and version that wrote them")
    source: Literal["machine", "simulated"] | None = Field(
        None, description="measured on the machine or on a simulated crane; none where not known"
    )

    @model_validator(mode="after")
    def _a_day(self) -> Self:
        try:
            date.fromisoformat(self.date)
        except ValueError:
            raise ValueError(f"date: expected one such as 2026-11-23, got {self.date!r}") from None
        return self


def written_by(verb: str, *, simulated: bool | None, log: str | None = None) -> dict[str, Any]:
    """Origin of numbers that are written now, by key.

    Args:
        verb: that writes them.
        simulated: whether they were measured on a simulated crane; None where it is not known.
        log: name of the log they were computed from.
    """
    values: dict[str, Any] = {"date": f"{datetime.now(UTC).date()}"}
    if log is not None:
        values["log"] = printable(log)
    values["by"] = f"canshaper {verb} {version()}"
    if simulated is not None:
        values["source"] = "simulated" if simulated else "machine"
    return values


def note(verb: str) -> str:
    """Return the comment that replaces those on numbers that a verb has written."""
    return f"Written by canshaper {verb}."


def simulated(part: Any, place: Place = ()) -> Iterator[Place]:
    """Where a part of a deployment has numbers that were measured on a simulated crane."""
    for where, section in sections(part, place):
        if isinstance(section, Origin) and section.source == "simulated":
            yield where
