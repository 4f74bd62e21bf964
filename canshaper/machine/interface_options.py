"""What a bus of python-can is opened with, against the signature of its interface."""

from collections.abc import Container, Iterator
from importlib import import_module
from inspect import Parameter, signature
from typing import Any, get_type_hints

from pydantic import PydanticSchemaGenerationError, TypeAdapter, ValidationError

from canshaper.config.bus import Bus
from canshaper.config.source import Place
from canshaper.errors import did_you_mean

# They carry CAN FD without being asked to.
ALWAYS_FD = frozenset(("udp_multicast", "virtual"))
# They take bit rate and switch of CAN FD without a parameter of that name (python-can 4.6).
UNNAMED_FD = frozenset(("kvaser", "neovi"))
# What stands elsewhere in the file, or is ours to say.
OURS = frozenset(("channel", "bitrate", "can_filters", "receive_own_messages"))
OURS |= {"fd", "data_bitrate"}

# Types where python-can does not name them.
UNTYPED = {"host": str, "port": int}


def option_faults(bus: Bus) -> Iterator[tuple[Place, str]]:
    """What is wrong with interface and options of a bus: the key in its section, and what.

    An interface whose module cannot be imported here is left to the daemon that opens it.
    """
    if bus.interface == "socketcan":
        if bus.options:
            yield ("options",), "expected none with socketcan, which the system sets up, got some"
        return
    from can.interfaces import BACKENDS  # noqa: PLC0415  (SocketCAN has no need of it)

    if bus.interface not in BACKENDS:
        text = f"expected an interface of python-can, got {bus.interface}"
        yield ("interface",), text + did_you_mean(bus.interface, BACKENDS)
        return
    module, name = BACKENDS[bus.interface]
    try:
        opens = getattr(import_module(module), name).__init__
    except Exception:  # each interface needs something else, which is not here
        return
    parameters = {
        key: parameter
        for key, parameter in list(signature(opens).parameters.items())[1:]
        if key not in OURS
        and parameter.kind in (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)
    }
    yield from _fd_faults(bus, signature(opens).parameters)
    for key, parameter in parameters.items():
        if parameter.default is Parameter.empty and key not in bus.options:
            yield ("options",), f"expected {key}, which {bus.interface} needs, got none"
    kinds = _kinds(opens)
    for key, value in bus.options.items():
        if key not in parameters:
            known = ", ".join(parameters) or "it has none"
            text = f"expected an option of {bus.interface} ({known}), got {key}"
            yield ("options", key), text + did_you_mean(key, parameters)
        elif fault := _value_fault(kinds.get(key, UNTYPED.get(key)), value):
            yield ("options", key), fault


def _fd_faults(bus: Bus, parameters: Container[str]) -> Iterator[tuple[Place, str]]:
    """Whether an interface with these parameters carries CAN FD as a bus has it."""
    if bus.interface in ALWAYS_FD | UNNAMED_FD:
        return
    for key, used in (("fd", bus.fd), ("data_bitrate", bus.fd and bus.data_bitrate)):
        if used and key not in parameters:
            yield (key,), f"expected an interface of python-can that takes it, got {bus.interface}"


def _kinds(opens: Any) -> dict[str, Any]:
    """Types of the parameters, where the interface has them."""
    try:
        return get_type_hints(opens)
    except Exception:  # names that only a type checker knows
        return {}


def _value_fault(kind: Any, value: object) -> str | None:
    """Why a value is none of a parameter's type; None where it is, or may be."""
    if kind is None:
        return None
    try:
        TypeAdapter(kind).validate_python(value, strict=True)
    except PydanticSchemaGenerationError:  # a class of python-can, which makes it of what it gets
        return None
    except ValidationError:
        expected = kind.__name__ if isinstance(kind, type) else str(kind)
        return f"expected {expected}, got {value!r}"
    return None
