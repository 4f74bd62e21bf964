"""Deployment file and DBC files brought together: codecs, or every problem at once."""

from collections.abc import Mapping
from pathlib import Path

from canshaper.checksums import package_line
from canshaper.codec.codecs import AxisStatusCodec, IdentityCodec, Sender, ServiceStatusCodec
from canshaper.codec.kernel_check import neutral_fault
from canshaper.codec.rewrite import RewrittenMessage
from canshaper.codec.signals import find_signal, special_name, status_faults
from canshaper.codec.valve import ValveMessage
from canshaper.config.bus import LAST_SPN, Bus, J1939Name
from canshaper.config.gateway import Gateway
from canshaper.config.load import load_config
from canshaper.config.schedule import Profile
from canshaper.config.schema import (
    AxisConfig,
    Status,
)
from canshaper.config.source import DeploymentError, Place
from canshaper.machine.deployment import BoundAxis, BoundRadial, Deployment
from canshaper.machine.filters import FilterBinder
from canshaper.machine.identity import Identity, filter_lines
from canshaper.machine.inputs import BoundSwitch
from canshaper.machine.stopping import stated_fault


def load_deployment(path: Path, inside: Path | None = None) -> Deployment:
    """Load a deployment file with its DBC files.

    Args:
        path: the deployment file.
        inside: read no DBC file outside of this directory, where somebody else made the file.

    Raises:
        DeploymentError: with every problem of all files.
    """
    config, source = load_config(path)
    return _Binder(config, source).deployment(path, inside)


class _Binder(FilterBinder):
    """Binds part by part; with any problem there is no deployment."""

    def deployment(self, path: Path, inside: Path | None) -> Deployment:
        config = self.config
        self._check_buses()
        self._check_node_ids()
        messages = self.load(path.parent, inside)
        if messages is None:
            raise DeploymentError(self.problems)
        joysticks = {n: self.joystick(n, joystick) for n, joystick in config.joysticks.items()}
        axes = {n: self._axis(n, axis) for n, axis in config.axes.items()}
        stop = self.stop(config.emergency_stop) if config.emergency_stop else None
        load_state = self.switch(("load_state",), config.load_state) if config.load_state else None
        profile = self.switch(("profile",), config.profile) if config.profile else None
        if profile and config.profile:
            codes = config.profile.codes.items()
            self._check_values(profile, {("profile", "codes", name): code for name, code in codes})
        if load_state:
            self._check_values(load_state, self._values_of_sets())
        service = self._status(("status",), config.status, ServiceStatusCodec)
        identity = self._status(("identity",), config.identity, IdentityCodec)
        if config.gateway:
            self._check_gateway(config.gateway, [a.valve.message for a in axes.values() if a])
        if config.control:
            self.check_control(config.control)
        if self.problems:
            raise DeploymentError(self.problems)
        return Deployment(
            path,
            config,
            messages,
            {n: joystick for n, joystick in joysticks.items() if joystick},
            {n: axis for n, axis in axes.items() if axis},
            stop,
            ServiceStatusCodec(service[0]) if service else None,
            service[1] if service else 0,
            Identity(
                self.source.sha256,
                {n: f.sha256 for n, f in zip(config.dbc, messages.files, strict=True)},
                (
                    *(line for kind in sorted(self.kinds) if (line := package_line(kind))),
                    *filter_lines(self._filter_kinds()),
                ),
            ),
            IdentityCodec(identity[0]) if identity else None,
            load_state,
            profile,
            self.on_bus,
            source=self.source,
        )

    def _filter_kinds(self) -> set[str]:
        """Of every filter that may run; breakpoints are of the kind of their axis or profile."""
        axes = self.config.axes.values()
        profiles = (profile for axis in axes for profile in axis.profiles.values())
        return {axis.filter.kind for axis in axes} | {profile.filter.kind for profile in profiles}

    def _values_of_sets(self) -> dict[Place, float]:
        """Values of the load state that the gain schedules name, by their places."""
        parts: dict[Place, AxisConfig | Profile] = {}
        for name, axis in self.config.axes.items():
            parts["axes", name] = axis
            parts |= {
                ("axes", name, "profiles", profile): part for profile, part in axis.profiles.items()
            }
        return {
            (*place, "gain_schedule", i, "breakpoint"): one.breakpoint
            for place, part in parts.items()
            for i, one in enumerate(part.gain_schedule)
        }

    def _check_values(self, switch: BoundSwitch, values: Mapping[Place, float]) -> None:
        """A value that the DBC names as an error is never taken, so it can choose nothing."""
        signal = find_signal(switch.message, switch.config.signal)
        assert signal is not None  # bound, so it is there
        for place, value in values.items():
            if name := special_name(signal, value):
                text = f"found {value:g}, which {signal.name} names {name} in the DBC"
                self.add(place, f"{text}; allowed is a value that is no error")

    def _check_node_ids(self) -> None:
        """Ids of nodes are used once."""
        for bus, config in self.config.buses.items():
            canopen = config.canopen
            if canopen is None:
                continue
            others = {f"nodes.{n}": node.id for n, node in canopen.nodes.items()}
            ids = {"node": canopen.node} | others
            seen: dict[int, str] = {}
            for name, number in ids.items():
                if number in seen:
                    where = (*name.split("."), "id") if name in others else (name,)
                    text = f"found {number}, which is the node id of {seen[number]}"
                    self.add(("buses", bus, "canopen", *where), f"{text}; allowed is another one")
                seen.setdefault(number, name)

    def _check_gateway(self, gateway: Gateway, valves: list[ValveMessage]) -> None:
        for i, bus in enumerate(gateway.between):
            if bus not in self.config.buses:
                names = ", ".join(self.config.buses)
                self.add(("gateway", "between", i), f"found {bus!r}, buses are {names}")
        for i, name in enumerate(gateway.blocked):
            if isinstance(found := self.messages.find(name), str):
                self.add(("gateway", "blocked", i), found)
        if gateway.fallback == "stop":
            return
        rewritten = [m.sender for m in valves if isinstance(m, RewrittenMessage)]
        if not rewritten:
            text = (
                f"found {gateway.fallback}, and no valve has the message of a joystick on the other"
            )
            self.add(("gateway", "fallback"), f"{text} bus; allowed is stop")
        faults = {neutral_fault(s.protection, s.fields.message.length): s for s in rewritten}
        for fault, sender in faults.items():
            if fault and gateway.fallback == "neutral":
                name = sender.fields.message.name
                self.add(("gateway", "fallback"), f"found neutral; {fault}, which {name} has")

    def _check_buses(self) -> None:
        seen: dict[tuple[str, str], str] = {}
        names: dict[J1939Name, str] = {}
        for name, bus in self.config.buses.items():
            key = (bus.interface, bus.channel)
            if key in seen:
                self.add(("buses", name), f"has the channel {bus.channel} of bus {seen[key]}")
            seen[key] = name
            self._check_match(name, bus)
            if bus.network and bus.interface != "udp_multicast":
                text = f"found true with {bus.interface}, allowed is it with udp_multicast only"
                self.add(("buses", name, "network"), text)
            if bus.j1939 is None:
                continue
            # Behind a gateway both may meet, and nobody would know which is meant.
            if (other := names.setdefault(bus.j1939.name, name)) != name:
                text = f"is the NAME of bus {other}; each node needs one of its own:"
                self.add(("buses", name, "j1939", "name"), f"{text} another ecu_instance will do")
            last = bus.j1939.first_spn + 2 * len(self.config.axes) - 1
            if last > LAST_SPN:
                text = f"found {bus.j1939.first_spn}, which makes the last one {last};"
                self.add(("buses", name, "j1939", "first_spn"), f"{text} allowed is {LAST_SPN}")

    def _check_match(self, name: str, bus: Bus) -> None:
        """What can be known of a device without it."""
        if bus.match is None:
            return
        if bus.interface != "socketcan":
            text = f"found it with the interface {bus.interface}, allowed is socketcan"
            self.add(("buses", name, "match"), text)
        rate = bus.match.bitrate
        if rate and bus.bitrate and rate != bus.bitrate:
            text = f"found {rate}, the bitrate of the bus is {bus.bitrate}; allowed is the same"
            self.add(("buses", name, "match", "bitrate"), text)
        for other, config in self.config.buses.items():
            if other == name:
                break
            if config.match and bus.match.may_be(config.match):
                text = f"may be the device of bus {other} too; allowed is another serial, path"
                self.add(("buses", name, "match"), f"{text} or port")

    def _axis(self, name: str, axis: AxisConfig) -> BoundAxis | None:
        place: Place = ("axes", name)
        before = len(self.problems)
        if axis.command.joystick not in self.config.joysticks:
            names = ", ".join(self.config.joysticks)
            self.add(
                (*place, "command", "joystick"),
                f"found {axis.command.joystick!r}, joysticks are {names}",
            )
        bound = self.valve((*place, "valve"), axis.valve, axis.command)
        status = self._status((*place, "status"), axis.status, AxisStatusCodec)
        if bound is None or len(self.problems) > before:
            return None
        message, codec, ticks = bound
        period_s = ticks * self.config.tick_ms / 1000.0
        self.check_filters(place, axis, period_s)
        timeout_ms = self.config.joysticks[axis.command.joystick].timeout_ms
        if fault := stated_fault(axis, timeout_ms=timeout_ms, period_s=period_s):
            self.add((*place, "limits", "stop_distance_m"), fault)
        if len(self.problems) > before:
            return None
        return BoundAxis(
            name,
            axis,
            message,
            codec,
            ticks,
            AxisStatusCodec(status[0]) if status else None,
            status[1] if status else 0,
            self._radial((*place, "radial_compensation"), axis),
            self.feedback((*place, "feedback"), axis.feedback) if axis.feedback else None,
            self.status_word((*place, "valve", "cia408", "status"), axis.valve.cia408.status)
            if axis.valve.cia408
            else None,
        )

    def _radial(self, place: Place, axis: AxisConfig) -> BoundRadial | None:
        config = axis.radial_compensation
        if config is None:
            return None
        target = self.config.axes.get(config.axis)
        if target is None or target is axis:
            others = ", ".join(n for n, a in self.config.axes.items() if a is not axis)
            self.add((*place, "axis"), f"found {config.axis!r}, other axes are {others}")
        elif target.sway is None:
            self.add((*place, "axis"), f"found {config.axis!r}, which has no sway data")
        elif self._cycle(target) != self._cycle(axis):
            self.add((*place, "axis"), f"found {config.axis!r}, whose valve has another cycle")
        else:
            self._asked_once(place, config.axis, axis)
        if axis.sway is None:
            self.add(place, "needs the sway data of its own axis; found no sway")
        radius = config.radius
        if radius is None:
            return BoundRadial(config, None)
        at: Place = (*place, "radius")
        bound = self.radius(at, radius)
        return BoundRadial(config, bound) if bound else None

    def _asked_once(self, place: Place, name: str, axis: AxisConfig) -> None:
        """An axis is asked by one other at most, and by none when it asks itself."""
        for other, config in self.config.axes.items():
            radial = config.radial_compensation
            if radial is None or config is axis:
                continue
            if other == name:
                text = f"found {name!r}, which has a radial compensation itself"
                self.add((*place, "axis"), text)
            elif radial.axis == name:
                self.add((*place, "axis"), f"found {name!r}, which axis {other} uses already")

    def _cycle(self, axis: AxisConfig) -> int | None:
        """Cycle of the axis' valve message; None where there is no such message."""
        found = self.messages.find(axis.valve.message)
        return None if isinstance(found, str) else found[1].cycle_time

    def _status(
        self,
        place: Place,
        status: Status | None,
        codec: type[AxisStatusCodec] | type[IdentityCodec] | type[ServiceStatusCodec],
    ) -> tuple[Sender, int] | None:
        if status is None:
            return None
        found = self.message(place, status.bus, status.message, takes=False)
        if not found:
            return None
        file, message = found
        faults = status_faults(message, codec.SIGNALS, codec.CODES)
        self.problems += [file.problem(message, fault) for fault in faults]
        ticks = self.period(file, message)
        use = dict.fromkeys(codec.SIGNALS, "a signal of the status")
        address = self.address(status.bus, message, takes=False)
        protection = self.protection(place, status, message, use, address)
        return (self.sender(status.bus, message, protection), ticks) if ticks else None
