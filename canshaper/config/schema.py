"""Schema of the deployment file. Unknown keys are errors; every number has a range and a unit."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from canshaper.config.bus import Bus, Control, Gateway
from canshaper.config.crane import CraneSection, Motion
from canshaper.config.desk import Accept, Uncertainty
from canshaper.config.filters import (
    Breakpoint,
    Filter,
    LoadState,
    Profile,
    ProfileSwitch,
    schedule_fault,
)
from canshaper.config.inputs import (
    InputSection,
    NamedCodes,
    Protected,
    Status,
    SwaySensorSection,
    SwitchNames,
    SwitchSection,
)
from canshaper.config.limits import Hydraulics, Limits, Slewing, Sway
from canshaper.config.section import VERSION, Section, number
from canshaper.shaping.registry import KINDS

WITHOUT_ENABLE = (
    ": nothing moves without a switch that is held. It may be a signal of the joystick's message"
    " (enable: SIGNAL, or SIGNAL/BIT), one of another message (a section in switches), or that of"
    " another joystick (enable_of)"
)


class Joystick(InputSection):
    """A joystick message and the switches in it."""

    enable: SwitchNames | None = None
    """Signal of the enable switch: 1 on, 0 off, everything else is invalid; SIGNAL/BIT is one bit
    of a signal, 0 the lowest. Or several switches, all needed, the one to press first: signals of
    the joystick's own message, JOYSTICK.SIGNAL of another one's, names of switches."""
    enable_of: str | None = None
    """Instead of enable: a joystick whose switches enable this one too, such as the grip rollers of
    one."""
    reset: str | None = Field(None, description="signal whose rising edge resets a trip")
    anti_sway_off: str | None = Field(
        None, description="signal that asks for the unshaped command while it is 1"
    )
    next_profile: str | None = Field(
        None, description="signal whose rising edge chooses the next profile"
    )
    node: str | None = Field(
        None, description="its CANopen node, whose heartbeats and emergencies then count"
    )
    stuck_s: Annotated[float, number(1, 3600, "s", "longest deflection without change")] = 20.0
    """A deflection that does not change at all for longer is stuck-at, at the end stop too."""

    @model_validator(mode="after")
    def _enabled(self) -> Self:
        if (self.enable is None) == (self.enable_of is None):
            got = "neither" if self.enable is None else "both"
            raise ValueError(f"expected one of enable and enable_of, got {got}{WITHOUT_ENABLE}")
        return self


class StatusWord(InputSection):
    """Status word of a valve of CiA 408."""

    signal: str = Field(description="signal with object 6041h, its low four bits the state")


class Cia408(Section):
    """State machine of a CANopen valve (CiA 408), which we bring to ACTIVE and supervise."""

    control: str = Field(description="signal of the valve message with object 6040h")
    status: StatusWord = Field(description="message of the valve with its status word")
    node: str | None = Field(None, description="name of the valve's node on its bus")


class EmergencyStop(InputSection):
    """An emergency stop that is reported on the bus. It does not replace the wired one."""

    signal: str = Field(description="signal of the stop: raw 0 is free, every other value stops")


class DirectionFlags(Section):
    """Direction flags of a joystick, as in J1939-71: 1 yes, 0 no, every other value invalid."""

    neutral: str = Field(description="signal that the joystick is in neutral")
    negative: str = Field(description="signal that the velocity is negative")
    positive: str = Field(description="signal that the velocity is positive")


class Scaling(Section):
    """Meaning of a velocity signal, where the DBC does not say it or says it wrong."""

    full: Annotated[float, number(1e-6, 1e9, "", "from zero to full command")] | None = None
    """From zero to full command, in the unit of the signal; by default the end of its DBC range,
    which is symmetrical but for one step of two's complement ([-128|127]: both ends are full)."""
    zero: Annotated[float, number(-1e9, 1e9, "", "value at zero command")] | None = None
    """Value of the signal at zero command, by default 0; of a joystick without a sign such as
    full: 1023, zero: 1024."""
    invert: bool = False
    """Positive is negative, where no flag, second signal, direction code or also has the sign."""

    @property
    def corrects(self) -> bool:
        """Return whether any key corrects the DBC."""
        return self.full is not None or self.zero is not None or self.invert


class Command(NamedCodes, Scaling):
    """Signal of a joystick from which an axis gets its demand."""

    joystick: str = Field(description="name of a joystick")
    signal: str = Field(description="signal with the velocity; its DBC range is full deflection")
    flags: DirectionFlags | None = None
    """Signals of the direction, only where the velocity has no sign of its own."""
    negative: str | None = Field(
        None, description="of a rocker with a signal for each direction, that of the negative one"
    )
    neutral_pct: Annotated[
        float, number(0.1, 20, "% of full deflection", "deflection that still counts as neutral")
    ] = 2.0

    @model_validator(mode="after")
    def _one_direction(self) -> Self:
        if self.flags and self.negative:
            raise ValueError("expected one of flags and negative, got both")
        if self.invert and (self.flags or self.negative):
            raise ValueError("invert: expected none where each direction has a signal of its own")
        return self


class DirectionCodes(Section):
    """Direction of a valve command as a code, such as the valve state of ISO 11783-7."""

    signal: str = Field(description="signal that carries the direction")
    neutral: Annotated[int, number(0, 255, "", "code of no command")]
    positive: Annotated[int, number(0, 255, "", "code of positive commands")]
    negative: Annotated[int, number(0, 255, "", "code of negative commands")]

    @model_validator(mode="after")
    def _different(self) -> Self:
        codes = (self.neutral, self.positive, self.negative)
        if len({*codes}) < len(codes):
            got = ", ".join(str(code) for code in codes)
            raise ValueError(f"expected three different codes, got {got}")
        return self


class Valve(Scaling, Protected):
    """Valve command message of an axis; we send it every GenMsgCycleTime of the DBC."""

    signal: str = Field(description="signal with the command; its DBC range is full command")
    direction: DirectionCodes | None = None
    """Codes of the direction, only where the command has no sign of its own."""
    also: list[str] = Field([])
    """Signals that carry the same command in another resolution; their DBC ranges begin at 0."""
    timeout_ms: Annotated[
        int,
        number(10, 5000, "ms", "silence after which the valve closes by itself (see its manual)"),
    ]
    cia408: Cia408 | None = None
    """State machine of a valve of CANopen."""
    node: str | None = None
    """CANopen node of a valve without CiA 408, such as a drive: its heartbeats and emergencies
    count."""

    @model_validator(mode="after")
    def _one_node(self) -> Self:
        if self.node is not None and self.cia408:
            raise ValueError("node: expected none with cia408, which has a key of that name")
        return self

    @model_validator(mode="after")
    def _sign(self) -> Self:
        if self.invert and self.direction:
            raise ValueError("invert: expected none with a direction, which has codes for both")
        if self.invert and self.also:
            raise ValueError(
                "invert: expected none with also, whose signals would stay as they are"
            )
        return self


class FeedbackSection(NamedCodes, InputSection):
    """Feedback of a valve: estimated flow, or position of the spool."""

    signal: str = Field(
        description="signal with the flow or position, its sign that of the command"
    )
    timeout_ms: Annotated[int, number(10, 5000, "ms", "age at which it counts as lost")]
    full: Annotated[float, number(1e-3, 1e6, "", "its value at full command")] | None = None
    """Value of the signal at full command; by default the end of its DBC range."""
    tolerance_pct: Annotated[
        float, number(1, 100, "% of full", "how far it may be from what was commanded")
    ] = 20.0
    settle_ms: Annotated[
        int, number(20, 2000, "ms", "how long the valve, and its message, may take to follow")
    ] = 500


class AxisSection(Section):
    """One axis: from which joystick, through which filter and limits, to which valve."""

    command: Command = Field(description="the joystick that commands the axis")
    valve: Valve = Field(description="the valve that moves the axis")
    feedback: FeedbackSection | None = None
    """Feedback of the valve, compared with what was commanded."""
    status: Status | None = None
    """Message with the status of the axis, with the signals of docs/states.md. Sent every
    GenMsgCycleTime and at every transition; no one else may use its id."""
    sway: Sway | None = None
    """Swing of the tool on this axis."""
    sway_sensor: SwaySensorSection | None = None
    """Sensor that measures that swing."""
    slewing: Slewing | None = None
    """Full speed in angle and radius of an axis that slews."""
    filter: Filter = Field(description="filter of the axis")
    gain_schedule: list[Breakpoint] = Field([], description="sway and filter by the load state")
    profiles: dict[str, Profile] = Field(
        {}, description="other filters that the operator may choose"
    )
    limits: Limits = Limits()
    """Output limits of the axis."""

    @property
    def damps(self) -> bool:
        """Return whether a sway sensor damps the swing of the axis."""
        return self.sway_sensor is not None and self.sway_sensor.use == "damp"

    @model_validator(mode="after")
    def _filter_has_sway(self) -> Self:
        if KINDS[self.filter.kind].needs_sway and self.sway is None:
            raise ValueError(f"expected sway data for filter {self.filter.kind}, got none")
        if fault := schedule_fault(self.filter.kind, self.gain_schedule):
            raise ValueError(fault)
        return self


class Tick(Section):
    """Timing of the ticks: the joystick that they follow."""

    follow: str = Field(description="joystick after whose frames the ticks are to come")


class DeploymentConfig(Section):
    """A machine: buses, DBC files, joysticks and axes."""

    version: Annotated[int, number(VERSION, VERSION, "", "version of the file's format")]
    tick_ms: Annotated[int, number(1, 50, "ms", "period of the control loop")] = 20
    tick: Tick | None = None
    """Joystick that the ticks follow."""
    buses: dict[str, Bus] = Field(min_length=1, description="CAN buses by name")
    dbc: list[str] = Field(min_length=1, description="DBC files, relative to this file")
    joysticks: dict[str, Joystick] = Field(min_length=1, description="joystick messages by name")
    switches: dict[str, SwitchSection] = Field(
        {}, description="switches in messages of their own that enable joysticks, by name"
    )
    axes: dict[str, AxisSection] = Field(min_length=1, description="axes by name")
    crane: CraneSection | None = Field(
        None, description="which axis moves which coordinate; by default their names say it"
    )
    motion: dict[str, Motion] = Field(
        {}, description="slew and near-far of a crane as one motion, by name"
    )
    hydraulics: Hydraulics | None = None
    """Oil that the pump delivers: the commands of all axes are scaled so that they ask for no
    more."""
    gateway: Gateway | None = None
    """The two buses between which we stand, where the machine's own ECU moves the valves."""
    emergency_stop: EmergencyStop | None = None
    """An emergency stop that is reported on the bus."""
    load_state: LoadState | None = None
    """Load of the crane; it selects the breakpoint in the gain schedules of the axes."""
    profile: ProfileSwitch | None = None
    """The operator's choice among the profiles of the axes."""
    status: Status | None = None
    """Message with the state and the counters of the service."""
    identity: Status | None = Field(
        None, description="message with a 16-bit signal Digest of what runs, sent once a second"
    )
    control: Control | None = None
    """Numbers that may be changed while the machine works."""
    assumed: list[str] = Field([], description="keys of numbers that no one has measured or typed")
    """Keys of numbers that are guesses of init until someone measures them (a verb with --write
    takes them out) or has them from a manual (then take them out here)."""
    still_deg: Annotated[
        float, number(0.2, 20, "deg", "swing below which the grapple counts as still")
    ] = 2.0
    """Swing below which the grapple counts as still, in reports."""
    uncertainty: Uncertainty = Uncertainty()
    """Ranges from which a campaign draws its drives."""
    accept: Accept = Accept()
    """Limits that a campaign has to keep."""
