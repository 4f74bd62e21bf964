"""Parts of which every configuration file is made."""

from typing import Any

from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema


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

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, use_attribute_docstrings=True
    )

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """JSON schema; an optional key without a description has that of what may stand there."""
        found = handler(schema)
        for key in handler.resolve_ref_schema(found).get("properties", {}).values():
            texts = [one["description"] for one in key.get("anyOf", ()) if "description" in one]
            if texts:
                key.setdefault("description", texts[0])
        return found
