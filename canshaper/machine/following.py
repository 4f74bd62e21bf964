"""Whether the ticks can follow a joystick: its frames need a time, and a cycle that fits."""

from collections.abc import Mapping

from canshaper.config.schema import DeploymentConfig
from canshaper.machine.diagnostics import Diagnostics
from canshaper.machine.inputs import BoundJoystick


def check_following(
    diagnostics: Diagnostics,
    config: DeploymentConfig,
    joysticks: Mapping[str, BoundJoystick | None],
) -> None:
    """The joystick that ``tick`` names is one that can be followed."""
    if config.tick is None:
        return
    name, place = config.tick.follow, ("tick", "follow")
    if name not in config.joysticks:
        names = ", ".join(config.joysticks)
        diagnostics.add(place, f"expected a joystick, got {name!r}; there are {names}")
    elif (joystick := joysticks[name]) and (fault := follow_fault(config, joystick)):
        diagnostics.add(place, f"{fault} of {name}")


def follow_fault(config: DeploymentConfig, joystick: BoundJoystick) -> str | None:
    """Why the ticks cannot follow a joystick; None where they can."""
    bus = config.buses.get(joystick.config.bus)
    if bus is not None and bus.interface != "socketcan":
        return f"expected a bus of socketcan, which stamps frames, got {bus.interface}, the bus"
    cycle_ms, tick_ms = joystick.message.cycle_time or 0, config.tick_ms
    if not cycle_ms or (cycle_ms % tick_ms and tick_ms % cycle_ms):
        got = f"{cycle_ms} ms" if cycle_ms else "none"
        expected = f"expected a GenMsgCycleTime that is a multiple or a part of {tick_ms} ms"
        return f"{expected}, got {got}, that"
    return None
