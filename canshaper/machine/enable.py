"""What enables a joystick: switches in its own message, in those of others, in their own."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from canshaper.codec.signals import find_signal, raw_limits
from canshaper.config.enable import conditions, named_by
from canshaper.config.inputs import Input, Switch
from canshaper.config.source import Place
from canshaper.machine.inputs import Bound, bind_input, check_source
from canshaper.machine.lookup import Lookup

# What of a section is about its message: the same for every switch in it.
_OF_MESSAGE = tuple(Input.model_fields)


@dataclass(frozen=True)
class BoundSwitches(Bound[Switch]):
    """A message with switches.

    Attributes:
        switches: signal and raw value that agrees, by name of the switch.
    """

    switches: Mapping[str, tuple[str, int]]


def signals_of(lookup: Lookup, joystick: str) -> Iterator[tuple[Place, str]]:
    """Signals of the message of a joystick that enable any, each once, with who names it first."""
    seen: set[str] = set()
    for owner, section in lookup.config.joysticks.items():
        for i, condition in enumerate(named_by(lookup.config, owner)):
            if condition.joystick == joystick and condition.name not in seen:
                seen.add(condition.name)
                yield _place(section.enable, owner, i), condition.name


def check_conditions(lookup: Lookup) -> None:
    """Names in the lists that are none."""
    config, add = lookup.config, lookup.diagnostics.add
    for name, section in config.joysticks.items():
        if (of := section.enable_of) is not None:
            names = [n for n, one in config.joysticks.items() if one.enable is not None]
            if of not in names:
                text = f"expected a joystick with enable, got {of!r}; there are {', '.join(names)}"
                add(("joysticks", name, "enable_of"), text)
        for i, text in enumerate(section.enable or ()):
            joystick, dot, _ = text.partition(".")
            place = _place(section.enable, name, i)
            if dot and joystick not in config.joysticks:
                names = list(config.joysticks)
                add(place, f"expected a joystick, got {joystick!r}; there are {', '.join(names)}")
            if text in (section.enable or ())[:i]:
                add(place, f"expected each switch once, got {text!r} again")


def bind_switches(lookup: Lookup) -> list[BoundSwitches]:
    """Every message with switches."""
    readers: dict[tuple[str, str], dict[str, Switch]] = {}
    config, add = lookup.config, lookup.diagnostics.add
    needed = {c for joystick in config.joysticks for c in conditions(config, joystick)}
    for name, switch in config.switches.items():
        readers.setdefault((switch.bus, switch.message), {})[name] = switch
        if (None, name) not in needed:
            add(("switches", name), f"expected a joystick that {name} enables, got none")
    return [one for switches in readers.values() if (one := _bind(lookup, switches))]


def _bind(lookup: Lookup, switches: dict[str, Switch]) -> BoundSwitches | None:
    """The switches of one message."""
    first, *others = switches
    config = switches[first]
    for other in others:
        text = f"switches.{first}, which reads the message too"
        place = ("switches", other)
        lookup.diagnostics.check_same(place, switches[other], _OF_MESSAGE, config, text)
    result = bind_input(lookup, ("switches", first), config, ("signal",))
    if result is None:
        return None
    used, bound = result
    check_source(used, "a switch")
    for other in others:
        used.integer(("switches", other, "signal"), switches[other].signal, f"switch {other}")
    for name, one in switches.items():
        agrees, at = {one.code: f"{name} agrees"}, ("switches", name, "signal")
        used.check_switch(at, one.signal, agrees, f"{name} does not agree")
        signal = find_signal(bound.message, one.signal)
        if signal and one.code > (largest := raw_limits(signal)[1]):
            text = f"expected up to {largest}, of {signal.length} bits of {signal.name}"
            lookup.diagnostics.add(("switches", name, "code"), f"{text}, got {one.code}")
    names = {name: (one.signal, one.code) for name, one in switches.items()}
    return BoundSwitches(**vars(bound), switches=names)


def _place(names: list[str] | None, joystick: str, i: int) -> Place:
    """Where a name stands: in a list of one it may stand alone."""
    place: Place = ("joysticks", joystick, "enable")
    return (*place, i) if names and len(names) > 1 else place
