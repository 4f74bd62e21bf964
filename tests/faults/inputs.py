"""The messages that a machine takes: its joysticks and its emergency stop."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from cantools.database.can import Message

from tests.faults.fields import CHECKSUMS, Field

if TYPE_CHECKING:
    from tests.faults.axis import Axis

# Source address that stands for any in a DBC file of J1939, and that of the joysticks there.
ANY_SOURCE, JOYSTICK = 0xFE, 0x33

Key = tuple[str, int, bool]


def key_of(bus: str, message: Message, source: int | None) -> Key:
    """A message on a bus; ``source`` is the address of its sender where it is one of J1939."""
    can_id, extended = message.frame_id, message.is_extended_frame
    if extended and source is not None and can_id & 0xFF == ANY_SOURCE:
        can_id = can_id & ~0xFF | source
    return bus, can_id, extended


class Input:
    """A message that the controller takes: a joystick or the emergency stop."""

    def __init__(self, name: str, section: dict[str, Any], message: Message) -> None:
        self.name = name
        self.key = key_of(section["bus"], message, section.get("source", JOYSTICK))
        self.message = message
        self.length = message.length
        self.cycle_ms: int = section.get("cycle_ms", message.cycle_time or 0)
        page = section.get("multiplexor")
        self.page = next((Field(s) for s in message.signals if s.is_multiplexer), None)
        self.page_code: int = page or 0
        self.timeout_ns = section["timeout_ms"] * 1_000_000
        self.fields = {
            s.name: Field(s)
            for s in message.signals
            if s.multiplexer_ids is None or page in s.multiplexer_ids
        }
        self.max_step = section.get("alive_max_step", 3)
        self.qualify = section.get("qualify", 1)
        counter = section.get("alive_counter")
        self.counter = self.fields[counter] if counter else None
        self.checksum: Callable[[bytes], int] | None = None
        self.checksum_byte = 0
        if check := section.get("checksum"):
            self.checksum = CHECKSUMS[check["kind"]]
            self.checksum_byte = self.fields[check["signal"]].start // 8

    def data(self, raw: dict[str, int], spoiled: int = 0) -> bytes:
        """Bytes of a frame; the checksum is right, or spoiled by these bits."""
        fields = self.fields
        word = self.page.put(self.page_code) if self.page else 0
        for name, value in raw.items():
            word |= fields[name].put(value)
        data = word.to_bytes(self.length, "little")
        if self.checksum is None:
            return data
        at = self.checksum_byte
        checksum = self.checksum(data[:at] + data[at + 1 :]) ^ spoiled
        return data[:at] + bytes([checksum]) + data[at + 1 :]

    def whole(self, data: bytes) -> bool:
        """Whether the checksum is right, or there is none."""
        at = self.checksum_byte
        return self.checksum is None or self.checksum(data[:at] + data[at + 1 :]) == data[at]


class Joystick(Input):
    """A joystick message with its switches."""

    def __init__(self, name: str, section: dict[str, Any], message: Message) -> None:
        super().__init__(name, section, message)
        names = section.get("enable", [])
        names = [names] if isinstance(names, str) else names
        # of its own message; the rollers of a grip have none
        self.enable = self.fields[names[0]] if names else None
        self.enabled_by: Joystick | None = None  # whose switch is pressed instead
        self.agree: list[tuple[Switches, str]] = []  # others, by message and signal
        self.reset = self.fields[section["reset"]] if "reset" in section else None
        self.off = self.fields[section["anti_sway_off"]] if "anti_sway_off" in section else None
        self.next_profile = self.fields.get(section.get("next_profile", ""))
        self.frozen_ns = round(section.get("stuck_s", 20.0) * 1e9)
        self.axes: list[Axis] = []

    def scaled(self, name: str, command: dict[str, Any]) -> Field:
        """The signal of a velocity, as the command says it is scaled."""
        signal = next(s for s in self.message.signals if s.name == name)
        self.fields[name] = Field(signal, command)
        return self.fields[name]

    def pressed(self, value: int = 1) -> dict[str, int]:
        """Its own enable switch in this position, where it has one."""
        return {self.enable.name: value} if self.enable else {}


class Switches(Input):
    """A message with switches that have to agree."""

    def __init__(self, section: dict[str, Any], message: Message) -> None:
        super().__init__("switches", section, message)
        self.codes: dict[str, int] = {}
