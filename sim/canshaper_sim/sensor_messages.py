"""Frames of the sway sensors that a deployment reads."""

import math
from collections.abc import Collection, Iterator, Mapping

from canshaper.codec.frame import Frame, MessageKey
from canshaper.codec.message import SentMessage
from canshaper.machine.deployment import Deployment
from canshaper.machine.sway_sensor import BoundSwaySensor
from canshaper_sim.axes import BRIDGE, SLEW
from canshaper_sim.crane import CraneState
from canshaper_sim.grapple import Sway
from canshaper_sim.sway_sensor import SwaySensor, SwaySensorParameters


class SensorMessage:
    """A message with the measurements of one or several sway sensors, sent each cycle.

    Args:
        axes: axis -> the sway sensor of the deployment that is read from this message.
        across: axes whose load swings by theta5: those that slew, or move the bridge.
        parameters: errors of the sensors.

    Attributes:
        node: name of the CANopen node that sends the message; None if no watched node sends it.
    """

    def __init__(
        self,
        axes: Mapping[str, BoundSwaySensor],
        across: Collection[str],
        parameters: SwaySensorParameters,
    ) -> None:
        first = next(iter(axes.values()))
        message, self.node = first.message, first.config.node
        self._sender = SentMessage(
            message.config.bus, message.message, message.key[1] & 0xFF, message.protection
        ).sender()
        self._merits = dict.fromkeys(message.merits.values(), 0)
        self._cycle_s = self._left_s = first.cycle_s
        self._lost_s = parameters.lost_s
        self._sensors = {
            bound.signal.name: (
                abs(bound.factor),
                SwaySensor(
                    parameters,
                    name,
                    across=name in across,
                    kind=bound.config.kind,
                ),
            )
            for name, bound in axes.items()
        }

    def frames(self, state: CraneState, passed_s: float) -> Iterator[Frame]:
        """Take the state passed_s after the last; yield the frame if due, none from lost_s on."""
        time_s = state.time_s
        sway = Sway(
            state.theta5_rad, state.theta6_rad, state.theta5_rate_rad_s, state.theta6_rate_rad_s
        )
        for _, sensor in self._sensors.values():
            sensor.swing(time_s, sway)
        self._left_s -= passed_s
        if self._left_s > 1e-9:
            return
        self._left_s += self._cycle_s
        if time_s < self._lost_s:
            fields = self._sender.fields
            raw = {
                name: fields.raw(name, math.radians(sensor.value(time_s)) / unit)
                for name, (unit, sensor) in self._sensors.items()
            }
            yield self._sender.frame(raw | self._merits)


def sensor_messages(
    deployment: Deployment, parameters: SwaySensorParameters
) -> list[SensorMessage]:
    """Return every message with sway that the deployment reads, each with all its sensors."""
    messages: dict[MessageKey, dict[str, BoundSwaySensor]] = {}
    for name, axis in deployment.axes.items():
        if bound := axis.sway_sensor:
            messages.setdefault(bound.message.key, {})[name] = bound
    moves = deployment.coordinates
    across = {name for name in deployment.axes if moves.get(name, name) in (SLEW, BRIDGE)}
    return [SensorMessage(axes, across, parameters) for axes in messages.values()]
