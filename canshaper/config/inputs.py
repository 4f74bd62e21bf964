"""Sections of inputs besides joysticks, and how a message is protected.

A message has an alive counter and a checksum, or a profile of AUTOSAR E2E.
"""

from typing import Annotated, Any, Literal, NamedTuple, Self

from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from canshaper.config.section import Origin, Section, number
from canshaper.shaping.sway import Measured


def _kinds(schema: dict[str, Any]) -> None:
    """Put the names of all kinds into the JSON schema, when the schema is made."""
    from canshaper.checksums.kinds import checksum_names

    schema["enum"] = checksum_names()


def _known(kind: object) -> str:
    from canshaper.checksums.kinds import known_checksum

    return known_checksum(kind)


class Checksum(Section):
    """Checksum of a message, over all its bits but its own."""

    signal: str
    """Signal that holds it, unsigned: half a byte, a byte, or two bytes in the byte order of the
    DBC."""
    kind: Annotated[str, BeforeValidator(_known)] | None = Field(
        None,
        description="how it is computed",
        examples=["crc8_sae_j1850"],
        json_schema_extra=_kinds,
    )
    polynomial: Annotated[int, number(1, 0xFFFF, "", "polynomial")] | None = None
    """Instead of a kind: polynomial, without its highest bit, of a CRC of as many bits as its
    signal has, 8 or 16."""
    start: Annotated[int, number(0, 0xFFFF, "", "register before the first byte")] = 0
    end: Annotated[int, number(0, 0xFFFF, "", "what changes the register after the last byte")] = 0
    reflected: bool = Field(False, description="the lowest bit of each byte comes first")

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.kind is None) == (self.polynomial is None):
            got = "neither" if self.kind is None else "both"
            raise ValueError(f"expected one of kind and polynomial, got {got}")
        if self.kind is not None and (self.start or self.end or self.reflected):
            raise ValueError("start, end and reflected: expected with polynomial, got kind")
        return self


class Profile(NamedTuple):
    """A profile of AUTOSAR E2E.

    Attributes:
        needs: keys of the data ID, which identifies the message.
        header: where CRC, counter and other parts lie in the frame.
        counter: values of the counter.
        crc: how the CRC is computed.
    """

    needs: tuple[str, ...]
    header: str
    counter: str
    crc: str


_MODE = ("data_id", "data_id_mode")
_HEADER = "CRC in byte 0, counter in the lower half of byte 1"
_CRC_1 = "SAE J1850, polynomial 0x1D, starts with 0, not inverted; data ID by its mode first"
_CRC_2 = "polynomial 0x2F, starts with 0xFF, inverted; the data ID of the counter last"
PROFILES = {
    "p01": Profile(_MODE, _HEADER, "0 to 14 (15 is invalid)", _CRC_1),
    "p02": Profile(("data_ids",), _HEADER, "0 to 15", _CRC_2),
    "p04": Profile(
        ("data_id",),
        "of CAN FD: 12 bytes, high bytes first: length, counter, data ID of 32 bits, CRC-32",
        "0 to 65535",
        "polynomial 0xF4ACFB13",
    ),
    "p05": Profile(
        ("data_id",),
        "CRC-16 in bytes 0 and 1, low byte first, counter in byte 2",
        "0 to 255",
        "polynomial 0x1021, starts with 0xFFFF; data ID of 16 bits last, low byte first",
    ),
    "p06": Profile(
        ("data_id",),
        "as p05 with high bytes first; bytes 2 and 3 are the length, byte 4 the counter",
        "0 to 255",
        "as p05 with high bytes first",
    ),
    "p07": Profile(
        ("data_id",),
        "of CAN FD: 20 bytes: CRC-64, then length, counter and data ID of 32 bits each",
        "of 32 bits",
        "polynomial 0x42F0E1EBA9EA3693",
    ),
    "p11": Profile(_MODE, "as p01", "0 to 14 (15 is invalid)", "as p01, both or nibble"),
    "p22": Profile(("data_ids",), "as p02", "0 to 15", "as p02"),
}
"""Profiles by their names in the file; docs/deployment.md has them as a table."""


class E2e(Section):
    """A profile of AUTOSAR E2E: CRC and counter in the first bytes of the message."""

    profile: Literal["p01", "p02", "p04", "p05", "p06", "p07", "p11", "p22"] = Field(
        description="profile of AUTOSAR E2E"
    )
    data_id: Annotated[int, number(0, 0xFFFF_FFFF, "", "data ID of the message")] | None = None
    """Data ID of the message: of 32 bits in profiles 4 and 7, else of 16."""
    data_id_mode: Literal["both", "low", "alternating", "nibble"] | None = None
    """Which bytes of the data ID enter the CRC, profiles 1 and 11: both, the low byte, then the
    high byte; low, the low byte; alternating, the low byte with even counters, the high byte with
    odd ones; nibble, the low byte, then zero, of 12 bits, whose upper four are sent in the upper
    half of byte 1. Profile 11 has both and nibble only."""
    data_ids: (
        Annotated[
            list[Annotated[int, number(0, 0xFF, "", "data ID")]],
            Field(min_length=16, max_length=16, description="data IDs by the counter"),
        ]
        | None
    ) = None
    """Profiles 2 and 22: 16 data IDs, of which the counter chooses one."""

    @model_validator(mode="after")
    def _complete(self) -> Self:
        needs = [*PROFILES[self.profile].needs]
        given = [k for k in ("data_id", "data_id_mode", "data_ids") if getattr(self, k) is not None]
        if given != needs:
            got = " and ".join(given) or "no data ID"
            expected = " and ".join(needs)
            raise ValueError(f"expected {expected} with profile {self.profile}, got {got}")
        if self.profile == "p11" and self.data_id_mode not in ("both", "nibble"):
            text = "expected both or nibble with profile p11"
            raise ValueError(f"data_id_mode: {text}, got {self.data_id_mode}")
        if (self.data_id or 0) > 0xFFFF and self.profile not in ("p04", "p07"):
            text = f"data_id: expected up to 0xffff with profile {self.profile}"
            raise ValueError(f"{text}, got {self.data_id:#x}")
        if self.data_id_mode == "nibble" and (self.data_id or 0) > 0xFFF:
            raise ValueError(f"data_id: expected up to 0xfff in mode nibble, got {self.data_id:#x}")
        return self


class Protected(Section):
    """A message that is received or sent, and its protection."""

    bus: str = Field(description="name of the bus of the message")
    message: str = Field(description="message in the DBC files")
    alive_counter: str | None = None
    """Unsigned signal that counts up with every message and begins again at 0."""
    checksum: Checksum | None = None
    """Checksum of the message."""
    e2e: E2e | None = None
    """Instead of both: a profile of AUTOSAR E2E."""
    cycle_ms: (
        Annotated[int, number(1, 60_000, "ms", "its period, instead of GenMsgCycleTime")] | None
    ) = None
    """Its period instead of GenMsgCycleTime, where the DBC has none or a wrong one."""
    multiplexor: Annotated[int, number(0, 2**32, "", "value of the multiplexor")] | None = None
    """Value of the multiplexor with which the message is meant; what we send carries it. Of frames
    with another value only checksum and counter are checked, where they have them too."""


class Status(Protected):
    """A status message for displays and tools."""


class InputSection(Protected):
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


class SwitchSection(InputSection):
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


Meaning = Literal["value", "fault"]


class NamedCodes(Section):
    """A signal that is read as a number."""

    codes: dict[str, Meaning] = Field({})
    """Meaning of each value that the DBC names (VAL_), by its name: value for a measurement like
    every other number, fault for no measurement, as without an entry."""


Kind = Literal["angle", "inclination", "rate"]


class SwaySensorSection(NamedCodes, InputSection):
    """A sensor that measures the swing of the tool in the plane of the axis.

    Several axes may read the same message. Offset, noise and largest offset are in degrees, those
    of a rate in degrees per second.
    """

    node: str | None = Field(None, description="name of its node on a bus of CANopen")
    signal: str = Field(description="signal with the angle, or the rate, of the swing")
    merit: str | None = Field(
        None, description="signal of its figure of merit, as in SSI: 0 good, all else measures none"
    )
    kind: Kind
    """Measured quantity: angle of a joint, inclination against the vertical, rate of a gyro."""
    fusion_s: (
        Annotated[
            float,
            number(0, 1000, "s", "time constant with which accelerations correct its gyro"),
        ]
        | None
    ) = None
    """Time constant with which an inclinometer corrects its gyro by accelerations, of its data
    sheet; 0 without a gyro."""
    use: Literal["watch", "damp"] = "watch"
    """watch only says whether it could be trusted; damp feeds the swing back, with filters of kind
    robust and gff."""
    invert: bool = Field(
        False, description="it is negative where the tip speeds up in positive direction"
    )
    delay_ms: Annotated[
        float, number(0, 500, "ms", "age of a measurement when its frame arrives")
    ] = 20.0
    valve_lag_ms: Annotated[
        float, number(0, 1000, "ms", "time constant from the valve's command to the tip's speed")
    ] = 100.0
    noise_deg: Annotated[float, number(0.01, 5, "deg, deg/s", "standard deviation")] | None = None
    """Standard deviation of its noise; by default 0.1 degrees, or 0.3 degrees per second."""
    offset_max_deg: Annotated[float, number(0.1, 20, "deg, deg/s", "largest offset")] = 3.0
    length_range_pct: Annotated[
        float,
        number(5, 300, "%", "most that the pendulum seems longer, or shorter"),
    ] = 60.0
    second_period_s: (
        Annotated[float, number(0.15, 3, "s", "period of a second swing that is left alone")] | None
    ) = None
    """Period of a second, quicker swing that it shows too, such as that of long logs: kept apart
    from the first one, and not damped."""
    origin: Origin | None = Field(None, description="where sign, delay, offset and noise come from")

    @property
    def measured(self) -> Measured:
        """Quantity that the sensor measures."""
        return Measured.RATE if self.kind == "rate" else Measured.ANGLE

    @property
    def noise(self) -> float:
        """Standard deviation of the noise, degrees or degrees per second."""
        if self.noise_deg is not None:
            return self.noise_deg
        return 0.1 if self.measured is Measured.ANGLE else 0.3
