"""Parts of which every configuration file is made."""

from typing import Any

from pydantic import BaseModel, ConfigDict, Field


def number(low: float, high: float, unit: str, text: str) -> Any:
    """Field of a number within [low, high]; the unit appears in errors and in the JSON schema."""
    return Field(
        ge=low,
        le=high,
        allow_inf_nan=False,
        description=f"{text} ({unit})" if unit else text,
        json_schema_extra={"unit": unit},
    )


class Section(BaseModel):
    """A part of the file: frozen, no unknown keys, no silent conversion of types."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)
