"""Sections of buses: interfaces, protocols, gateway, and the control socket."""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, WithJsonSchema, model_validator

from canshaper.config.section import Section, number

# The maker's own range of suspect parameter numbers ends here; an axis takes two: one for its
# commands, one for its valve.
LAST_SPN = 524287


class J1939Name(Section):
    """NAME of our node (SAE J1939-81): it identifies the node and decides who wins an address."""

    identity_number: Annotated[int, number(0, 2_097_151, "", "serial number of the PC")]
    manufacturer_code: Annotated[int, number(0, 2047, "", "code that SAE gave to the maker")]
    function: Annotated[int, number(0, 255, "", "function code")] = 129
    """Function code; 129 in industry group 2, vehicle system 0: operator controls, machine
    specific."""
    ecu_instance: Annotated[int, number(0, 7, "", "instance of the ECU")] = 0
    function_instance: Annotated[int, number(0, 31, "", "instance of the function")] = 0
    vehicle_system: Annotated[int, number(0, 127, "", "vehicle system, or device class")] = 0
    vehicle_system_instance: Annotated[int, number(0, 15, "", "instance of that")] = 0
    industry_group: Annotated[int, number(0, 7, "", "2 is agriculture and forestry")] = 2


class J1939(Section):
    """Our node on a bus of J1939 or ISO 11783."""

    address: Annotated[int, number(0, 253, "", "source address of all that we send")]
    name: J1939Name
    """NAME of our node (SAE J1939-81), unique among all PCs and buses of the machine; the lower
    NAME wins an address."""
    first_spn: Annotated[
        int, number(1, LAST_SPN - 1, "", "suspect parameter number of the first axis in DM1")
    ] = 520192
    """Suspect parameter number of the first axis in DM1, by default the first of the range that is
    free to every maker."""


class CanopenNode(Section):
    """Another node of CANopen that is watched."""

    id: Annotated[int, number(1, 127, "", "its node id")]
    heartbeat_ms: Annotated[int, number(20, 10_000, "ms", "longest time between its heartbeats")]
    """Silence after which the node is lost: two or three of its heartbeats (1017h, which some
    makers deliver as off)."""


class Canopen(Section):
    """Our node on a bus of CANopen."""

    node: Annotated[int, number(1, 127, "", "our node id, unique on the bus")]
    heartbeat_ms: Annotated[int, number(20, 10_000, "ms", "time between our heartbeats")] = 200
    master: bool = False
    """We start every supervised node that is not operational; else we never send NMT."""
    nodes: dict[str, CanopenNode] = Field({}, description="other nodes, by a name of your choice")

    def __hash__(self) -> int:
        """Return a hash of all but the names: a bus is a key of the open buses."""
        return hash((self.node, self.heartbeat_ms, self.master, *self.nodes.values()))


class Match(Section):
    """The device that a SocketCAN bus must be: it has to match every key that is given."""

    serial: str | None = Field(None, min_length=1)
    """Serial number of the USB adapter, in quotes."""
    path: str | None = Field(None, min_length=1)
    """Where the device is plugged in: udev's ID_PATH, such as pci-0000:00:14.0-usb-0:3:1.0."""
    port: Annotated[int, number(0, 63, "", "channel of an adapter with several")] | None = None
    """Channel of an adapter with several, from 0: dev_port of the interface, in older drivers
    dev_id."""
    driver: str | None = Field(None, min_length=1)
    """Driver of the kernel, such as peak_usb or vcan."""
    bitrate: Annotated[int, number(10_000, 1_000_000, "bit/s", "bit rate")] | None = None
    """Bit rate that the interface must have; by default the bit rate of the bus, for an interface
    that has one, and its data bit rate."""

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        if not self.model_dump(exclude_none=True):
            raise ValueError(f"expected one of {', '.join(type(self).model_fields)}, got none")
        return self

    def may_be(self, other: "Match") -> bool:
        """Return whether both may match one device: they share serial or path, and no key differs.

        An adapter whose channels are not distinguished by ``port`` counts as one device.
        """
        keys = ("serial", "path", "port")
        both = [(getattr(self, key), getattr(other, key)) for key in keys]
        return any(one is not None and one == two for one, two in both[:2]) and all(
            None in (one, two) or one == two for one, two in both
        )


def _scalar(value: object) -> object:
    if not isinstance(value, bool | int | float | str):
        raise ValueError(f"expected a text, a number, true or false, got {value!r}")
    return value


Scalar = Annotated[
    Any, AfterValidator(_scalar), WithJsonSchema({"type": ["boolean", "number", "string"]})
]


class Bus(Section):
    """A CAN bus, in the words of python-can."""

    interface: str = Field(description="python-can interface, such as socketcan")
    channel: str = Field(description="channel of the interface, such as can0")
    bitrate: Annotated[int, number(10_000, 1_000_000, "bit/s", "bit rate")] | None = None
    """Bit rate, by which check computes the bus load; the system sets SocketCAN itself."""
    fd: bool = False
    """CAN FD: messages of up to 64 bytes, classical frames share the bus. Without it check refuses
    messages of CAN FD."""
    data_bitrate: (
        Annotated[int, number(10_000, 10_000_000, "bit/s", "bit rate of the data of CAN FD")] | None
    ) = None
    """Bit rate of the data of CAN FD: with it frames are sent with bit rate switch (BRS), without
    it at one bit rate; received frames count with and without BRS."""
    options: dict[str, Scalar] = Field({})
    """Further options with which python-can opens the interface, such as
    { host: 10.0.0.5, port: 29536 } for socketcand."""
    match: Match | None = Field(
        None, description="the device behind the channel; without it the name alone counts"
    )
    unconfirmed: bool = Field(
        False, description="drive valves by an interface of SocketCAN without an echo (slcan) too"
    )
    """Such an interface never says whether a frame got onto the bus: a cut line trips no axis."""
    network: bool = Field(
        False, description="share a bus of udp_multicast over the network; else it stays local"
    )
    j1939: J1939 | None = None
    """Our node, on a bus of J1939 or ISO 11783."""
    canopen: Canopen | None = None
    """Our node, on a bus of CANopen."""

    @property
    def is_virtual(self) -> bool:
        """Return whether no machine can be on the bus: it is in this computer, or runs over UDP."""
        if self.interface == "socketcan":
            return self.channel.startswith(("vcan", "vxcan"))
        return self.interface in ("virtual", "udp_multicast")

    def __hash__(self) -> int:
        """Return a hash of interface and channel: a bus is a key of the open buses."""
        return hash((self.interface, self.channel))


class Gateway(Section):
    """Inline gateway between two buses: joystick frames leave with our velocities in them."""

    between: Annotated[list[str], Field(min_length=2, max_length=2, description="the two buses")]
    forwarding: Literal["kernel", "daemon"] = "kernel"
    """Who forwards all other frames: the kernel, by rules of can-gw, also while the daemon is away;
    or the daemon, where the kernel has no can-gw: then nothing passes without the daemon."""
    fallback: Literal["stop", "neutral", "pass"] = "stop"
    """Joysticks while the daemon is away. With stop their frames do not pass; with neutral they
    pass with all rewritten axes in neutral; with pass they pass as they are: **the raw joystick
    moves the machine**."""
    blocked: list[str] = Field([], description="messages that are not forwarded, by name")

    @model_validator(mode="after")
    def _possible(self) -> Self:
        first, second = self.between
        if first == second:
            raise ValueError(f"between: expected two different buses, got {first} twice")
        if self.forwarding == "daemon" and self.fallback != "stop":
            raise ValueError(
                f"fallback: expected stop with forwarding: daemon, got {self.fallback}:"
                " without the daemon nothing passes"
            )
        return self

    def other(self, bus: str) -> str | None:
        """Return the bus on the other side; None where ``bus`` is not one of the gateway's two."""
        if bus not in self.between:
            return None
        return self.between[1 - self.between.index(bus)]


# Where the service has a directory for each instance (RuntimeDirectory of the unit).
RUNTIME = Path("/run/canshaper")
End = Annotated[float, number(-1e6, 1e6, "", "end of the range, in the number's own unit")]


REDUCED_PCT = 40.0
"""Reduced speed, % of full speed: of a first motion, and while faults are rehearsed."""


class Control(Section):
    """The control socket of the daemon, and the numbers that ``canshaper set`` may change."""

    socket: str | None = Field(None, description="path of the socket")
    """Where the daemon listens, by default /run/canshaper/NAME/control.sock, NAME of the file; the
    option --control PATH of run and set names another path."""
    mode: str = Field("0600", pattern="^0[0-7]{3}$")
    """File mode of the socket, octal, in quotes: who may write to it may change the numbers."""
    adjustable: dict[str, Annotated[list[End], Field(min_length=2, max_length=2)]] = Field({})
    """Least and most of each adjustable number, by its keys with dots between: those of sway and
    filter in the file, and max_pct, rise_per_s, fall_per_s of limits. Not on axes with
    gain_schedule or profiles."""
    rehearse_faults: bool = Field(False, description="let canshaper fault make faults of inputs")
    """For commissioning: canshaper fault may make faults of the inputs while the machine runs. Only
    at reduced speed: with max_pct of every axis and motion up to 40."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not (self.adjustable or self.rehearse_faults):
            raise ValueError("adjustable: expected a number to change, or rehearse_faults")
        if int(self.mode, 8) & 0o002:
            others = f"0{int(self.mode, 8) & ~0o007:03o}"
            text = f"expected no right to write for others, such as {others!r}, got {self.mode!r}"
            raise ValueError(f"mode: {text}: every user of this PC could change the numbers")
        for key, (low, high) in self.adjustable.items():
            if not low <= high:
                text = f"{key}: expected the lower end first, got {low:g} to {high:g}"
                raise ValueError(text)
        return self

    def path(self, file: Path) -> Path:
        """Return the path of the socket for this deployment file."""
        return Path(self.socket) if self.socket else RUNTIME / file.stem / "control.sock"
