"""A trap: a machine made wrong as a stranger would, and the words with which it is refused."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from canshaper.commissioning.likely_mistakes import warnings_of
from canshaper.errors import ConfigError
from tests.rigs.files import Machine

Changes = Mapping[str, str]
NONE: Changes = MappingProxyType({})


class Trap(NamedTuple):
    """One wrong machine.

    Attributes:
        name: what is wrong.
        words: expected in the one line about it.
        yaml: pieces of the deployment file, and what replaces them.
        dbc: of its DBC file; a piece "" stands for its end.
        of: the shipped files that it is made from.
        extra: text of a second DBC file.
        warns: a machine may be meant so: a warning.
    """

    name: str
    words: str
    yaml: Changes = NONE
    dbc: Changes = NONE
    of: tuple[str, str] = ("forwarder.yaml", "forwarder.dbc")
    extra: str = ""
    warns: bool = False


J1939 = ("j1939-forwarder.yaml", "j1939-bjm-avc.dbc")


def made(trap: Trap, machine: Machine) -> Machine:
    """The machine with the trap in its files."""
    machine.become(*trap.of)
    for old, new in trap.yaml.items():
        machine.in_yaml(old, new)
    for old, new in trap.dbc.items():
        if old:
            machine.in_dbc(old, new)
        else:
            machine.dbc += f"{new}\n"
    if trap.extra:
        (machine.directory / "extra.dbc").write_text(trap.extra, encoding="cp1252")
        machine.in_yaml("[machine.dbc]", "[machine.dbc, extra.dbc]")
    return machine


def said(machine: Machine) -> tuple[list[str], list[str]]:
    """Problems and warnings of a machine."""
    try:
        deployment = machine.load()
    except ConfigError as error:
        return [str(problem) for problem in error.problems], []
    # Each shipped file that has two filters lacks hydraulics: of no trap.
    warnings = [str(warning) for warning in warnings_of(deployment)]
    return [], [warning for warning in warnings if "hydraulics: missing" not in warning]
