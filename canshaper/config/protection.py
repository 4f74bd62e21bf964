"""How a message is protected, taken or sent: counter and checksum, or a profile of AUTOSAR E2E."""

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from canshaper.checksums import checksum_names, known_checksum
from canshaper.config.section import Section, number


def _kinds(schema: dict[str, Any]) -> None:
    """Names of the kinds into the JSON schema, when that is made."""
    schema["enum"] = checksum_names()


class Checksum(Section):
    """Checksum of a message, over all its bits but its own."""

    signal: str = Field(description="signal that holds it: half a byte, a byte, or two bytes")
    kind: Annotated[str, BeforeValidator(known_checksum)] = Field(
        description="how it is computed", examples=["crc8_sae_j1850"], json_schema_extra=_kinds
    )


class E2e(Section):
    """Profile 1 or 2 of AUTOSAR E2E: CRC in byte 0, counter in the lower half of byte 1."""

    profile: Literal["p01", "p02"] = Field(description="profile of AUTOSAR E2E")
    data_id: Annotated[int, number(0, 0xFFFF, "", "data ID of the message, profile 1")] | None = (
        None
    )
    data_id_mode: Literal["both", "low", "alternating", "nibble"] | None = None
    """Which bytes of the data ID enter the CRC, profile 1."""
    data_ids: (
        Annotated[
            list[Annotated[int, number(0, 0xFF, "", "data ID")]],
            Field(min_length=16, max_length=16, description="data IDs by the counter, profile 2"),
        ]
        | None
    ) = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        needs = {"p01": ["data_id", "data_id_mode"], "p02": ["data_ids"]}[self.profile]
        given = [k for k in ("data_id", "data_id_mode", "data_ids") if getattr(self, k) is not None]
        if given != needs:
            got = " and ".join(given) or "no data ID"
            expected = " and ".join(needs)
            raise ValueError(f"expected {expected} with profile {self.profile}, got {got}")
        if self.data_id_mode == "nibble" and (self.data_id or 0) > 0xFFF:
            raise ValueError(f"data_id: expected up to 0xfff in mode nibble, got {self.data_id:#x}")
        return self


class Protected(Section):
    """A message that is taken or sent, and its protection."""

    bus: str = Field(description="name of the bus of the message")
    message: str = Field(description="message in the DBC files")
    alive_counter: str | None = Field(None, description="signal counted up with every message")
    checksum: Checksum | None = None
    """Checksum of the message."""
    e2e: E2e | None = None
    """Instead of both a profile of AUTOSAR E2E."""
