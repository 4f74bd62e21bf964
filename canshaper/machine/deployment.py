"""A deployment after all checks: the content of its files, and the codecs of its messages."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from cantools.database.can import Message

from canshaper.codec.frame import MessageKey
from canshaper.codec.layout import is_j1939
from canshaper.codec.message import SentMessage
from canshaper.codec.status import AIM, StatusCodec
from canshaper.config.crane import Motion, Radius, coordinates
from canshaper.config.inputs import InputSection
from canshaper.config.limits import OtherFlow
from canshaper.config.schema import DeploymentConfig, EmergencyStop
from canshaper.config.source import Place, Source
from canshaper.machine.buses import BusLoad, bus_load
from canshaper.machine.database import Messages
from canshaper.machine.identity import Identity, bind_status
from canshaper.machine.inputs import Bound, BoundValue, Choosing, bind_radius
from canshaper.machine.joysticks import BoundJoystick, BoundSwitches
from canshaper.machine.lookup import Lookup
from canshaper.machine.routing import Routing, build_routing
from canshaper.machine.used_message import NamedCode, StartValue
from canshaper.machine.valves import BoundAxis


@dataclass(frozen=True)
class BoundMotion:
    """A two-axis motion with its messages.

    Attributes:
        config: section of the motion.
        radius: message with the measured radius, or None.
        aim: message with the aim point, or None.
        aim_ticks: ticks between two of these messages.
    """

    config: Motion
    radius: BoundValue[Radius] | None = None
    aim: StatusCodec[Any] | None = None
    aim_ticks: int = 0


def bind_motions(lookup: Lookup) -> dict[str, BoundMotion]:
    """Bind every two-axis motion; return them by name. An axis may be part of one at most."""
    moved: dict[str, str] = {}
    motions = {}
    for name, motion in lookup.config.motion.items():
        place: Place = ("motion", name)
        for key in ("slew", "near_far", "luffing"):
            _check_axis(lookup, (*place, key), getattr(motion, key), moved, turns=key == "slew")
        _check_crane(lookup, (*place, "near_far"), motion)
        slewing = lookup.config.axes[motion.slew].slewing if motion.slew in moved else None
        if slewing and motion.radius_m and motion.radius_m > slewing.largest_radius_m:
            text = f"expected up to largest_radius_m of {motion.slew}, {slewing.largest_radius_m:g}"
            lookup.diagnostics.add((*place, "radius_m"), f"{text}, got {motion.radius_m:g}")
        radius = bind_radius(lookup, (*place, "radius"), motion.radius) if motion.radius else None
        aim = bind_status(lookup, (*place, "aim"), motion.aim, AIM)
        motions[name] = BoundMotion(motion, radius, *aim)
    return motions


def _check_axis(
    lookup: Lookup, place: Place, name: str | None, moved: dict[str, str], *, turns: bool
) -> None:
    if name is None:
        return
    add, axes = lookup.diagnostics.add, lookup.config.axes
    at = ".".join(str(part) for part in place)
    if not lookup.diagnostics.check_name(place, "an axis", name, axes):
        return
    if name in moved:
        add(place, f"expected an axis that is in no other motion, got {name!r} of {moved[name]}")
    moved.setdefault(name, at)
    for key in ("sway", "slewing") if turns else ("sway",):
        if getattr(axes[name], key) is None:
            add(place, f"expected an axis with {key}, got {name!r} without")


def _check_crane(lookup: Lookup, place: Place, motion: Motion) -> None:
    """Check that slew and near-far are of one crane, if named as usual (front_slew)."""
    slew, near_far = motion.slew, motion.near_far
    if near_far is None or not (slew.endswith("slew") and near_far.endswith("near_far")):
        return
    crane = slew.removesuffix("slew")
    if near_far.removesuffix("near_far") != crane:
        text = f"expected an axis of the same crane as {slew!r}, got {near_far!r}"
        lookup.diagnostics.add(place, text)


@dataclass(frozen=True, kw_only=True)
class Deployment:
    """Everything that the controller needs of the deployment file and DBC files, checked."""

    path: Path
    config: DeploymentConfig
    messages: Messages
    joysticks: dict[str, BoundJoystick]
    axes: dict[str, BoundAxis]
    motions: dict[str, BoundMotion]
    other_flow: BoundValue[OtherFlow] | None
    emergency_stop: Bound[EmergencyStop] | None
    status: StatusCodec[dict[str, int]] | None
    status_ticks: int
    identity: Identity
    identity_status: StatusCodec[int] | None
    load_state: BoundValue[Choosing] | None
    profile: BoundValue[Choosing] | None
    switches: list[BoundSwitches]
    on_bus: dict[str, list[Message]]
    fd: frozenset[MessageKey]
    """Used messages, received or sent, in frames of CAN FD, by (bus, id, extended)."""
    source: Source = field(compare=False)
    """The deployment file with line numbers, for problems that show only on this computer."""
    codes: tuple[NamedCode, ...] = ()
    """Meanings of the named values of the signals that are read."""
    starts: tuple[StartValue, ...] = ()
    """Start values of valve messages in signals that no axis uses."""
    listen_only: bool = False
    """Whether we send only status, as another controller, or none, drives the machine."""

    def load(self, bus: str) -> BusLoad | None:
        """Return the load of a bus by the deployment's messages; None without its bit rate."""
        config = self.config.buses[bus]
        if not config.bitrate:
            return None
        return bus_load(self.on_bus.get(bus, []), config.bitrate, config.data_bitrate)

    @cached_property
    def routing(self) -> Routing:
        """Routing table of all buses, for every part that receives or sends."""
        used = {bus for bus, messages in self.on_bus.items() if any(map(is_j1939, messages))}
        return build_routing(
            self.config,
            inputs=self.inputs(),
            axes=self.axes.values(),
            statuses=[status.message.key for status in self._statuses()],
            known=self.messages.ids(),
            j1939=used,
            fd=self.fd,
            listen_only=self.listen_only,
        )

    @cached_property
    def coordinates(self) -> Mapping[str, str]:
        """Coordinate of the crane that each axis moves, by axis."""
        return coordinates(self.config.crane, self.axes)

    @property
    def by_coordinate(self) -> dict[str, str]:
        """Axis that moves each coordinate of the crane, by coordinate."""
        return {moved: axis for axis, moved in self.coordinates.items()}

    def inputs(self) -> list[Bound[InputSection]]:
        """Return every received message once: joysticks, switches, sensors, feedback and so on."""
        axes = self.axes.values()
        reports = [i for axis in axes for i in (axis.feedback, axis.status_word)]
        # Several parts may read one message.
        radii = (motion.radius for motion in self.motions.values())
        read = [*radii, *(one for axis in axes for one in (axis.ends, axis.rope)), self.other_flow]
        positions = {one.key: one for one in read if one}.values()
        sensors = {s.message.key: s.message for axis in axes if (s := axis.sway_sensor)}.values()
        others = (
            self.emergency_stop,
            self.load_state,
            self.profile,
            *reports,
            *positions,
            *sensors,
        )
        return [*self.joysticks.values(), *self.switches, *(i for i in others if i)]

    @property
    def stopping_inputs(self) -> list[Bound[InputSection]]:
        """Inputs without which nothing may move: joysticks, their switches, emergency stop."""
        stop = [self.emergency_stop] if self.emergency_stop else []
        return [*self.joysticks.values(), *self.switches, *stop]

    def sent(self) -> list[SentMessage]:
        """Return every valve and status message of the machine once, even if we only listen."""
        valves = [axis.valve.message for axis in self.axes.values()]
        statuses = [status.message for status in self._statuses()]
        return list({one.key: one for one in (*valves, *statuses)}.values())

    def listening(self) -> "Deployment":
        """Return the machine for a program that only listens, and reports what it would command.

        Feedback, status words and swing follow another controller's commands, so they are not
        compared with ours. Our node on J1939 stays where a status message needs its address, which
        it gives up to any node that has it.
        """
        reporting = {s.message.key[0] for s in self._statuses()}
        buses = {
            name: bus if name in reporting else bus.model_copy(update={"j1939": None})
            for name, bus in self.config.buses.items()
        }
        axes = {
            name: replace(axis, feedback=None, status_word=None, sway_sensor=None)
            for name, axis in self.axes.items()
        }
        config = self.config.model_copy(update={"buses": buses})
        return replace(self, config=config, axes=axes, listen_only=True)

    @cached_property
    def unreported(self) -> "Deployment":
        """The same machine without status messages, for use where no one reads them."""
        axes = {
            name: replace(axis, status=None, status_ticks=0) for name, axis in self.axes.items()
        }
        motions = {name: replace(one, aim=None) for name, one in self.motions.items()}
        return replace(self, axes=axes, motions=motions, status=None, identity_status=None)

    def _statuses(self) -> list[StatusCodec[Any]]:
        """Return every status message that we send."""
        of_axes = [axis.status for axis in self.axes.values()]
        aims = [motion.aim for motion in self.motions.values()]
        return [s for s in (self.status, self.identity_status, *of_axes, *aims) if s]
