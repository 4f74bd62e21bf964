"""Which switches enable a joystick, as the deployment file names them."""

from typing import NamedTuple

from canshaper.config.schema import DeploymentConfig


class Condition(NamedTuple):
    """A switch that enables a joystick.

    Attributes:
        joystick: joystick whose message has the switch; None for one of ``switches``.
        name: name of the signal, or of the switch in ``switches``.
    """

    joystick: str | None
    name: str


def named_by(config: DeploymentConfig, joystick: str) -> tuple[Condition, ...]:
    """Return the switches that the joystick's own ``enable`` lists, not those of ``enable_of``."""
    return tuple(_condition(config, joystick, n) for n in config.joysticks[joystick].enable or ())


def conditions(config: DeploymentConfig, joystick: str) -> tuple[Condition, ...]:
    """Return the switches that enable a joystick: all are needed, the first is pressed first."""
    of = config.joysticks[joystick].enable_of or joystick
    return named_by(config, of) if of in config.joysticks else ()


def own_switch(config: DeploymentConfig, joystick: str) -> str | None:
    """Return the only switch of a joystick if its own message has it; None otherwise."""
    switches = conditions(config, joystick)
    return switches[0].name if len(switches) == 1 and switches[0].joystick == joystick else None


def slowest_ms(config: DeploymentConfig, joystick: str) -> int:
    """Return the longest age limit (ms) of a joystick and of the switches that enable it."""
    timeouts = [config.joysticks[joystick].timeout_ms]
    for of, name in conditions(config, joystick):
        one = config.switches.get(name) if of is None else config.joysticks.get(of)
        timeouts += [one.timeout_ms] if one else []
    return max(timeouts)


def _condition(config: DeploymentConfig, owner: str, text: str) -> Condition:
    joystick, dot, signal = text.partition(".")
    if dot:
        return Condition(joystick, signal)
    return Condition(None, text) if text in config.switches else Condition(owner, text)
