"""The operator's choice among the profiles of the axes: a switch, or a button for the next one."""

from collections.abc import Mapping, Sequence
from typing import Protocol

from canshaper.config.schema import DeploymentConfig
from canshaper.inputs.joystick import JoystickInput
from canshaper.inputs.value import ValueInput

OWN = "normal"
"""What people read for the axes' own filters, whose name is ""."""


class ProfileChoice(Protocol):
    """Says which profile is chosen."""

    def name(self, now_ns: int) -> str:
        """Name of the profile; "" for the axis' own filter."""


class ProfileSwitch:
    """A switch or display that repeats the code of the choice.

    Args:
        value: the code.
        codes: codes of the profiles by name.
    """

    def __init__(self, value: ValueInput, codes: Mapping[str, int]) -> None:
        self._value = value
        self._names = {float(code): name for name, code in codes.items()}

    def name(self, now_ns: int) -> str:
        """That of the code; the axis' own filter for any other one, and after silence."""
        code = self._value.fresh(now_ns)
        return "" if code is None else self._names.get(code, "")


class ProfileButtons:
    """Buttons of joysticks: each press chooses the next profile, behind the last one the first.

    Args:
        joysticks: those that have such a button.
        names: the profiles in their order; it begins with the axis' own filter.
    """

    def __init__(self, joysticks: Sequence[JoystickInput], names: Sequence[str]) -> None:
        self._joysticks = tuple(joysticks)
        self._names = tuple(names)

    def name(self, _now_ns: int) -> str:
        """That of the presses so far; a joystick that is lost changes nothing."""
        presses = sum(joystick.presses for joystick in self._joysticks)
        return self._names[presses % len(self._names)]


def profile_names(config: DeploymentConfig) -> list[str]:
    """Every profile, in the order of the file, behind "", the axes' own filters."""
    return ["", *dict.fromkeys(name for axis in config.axes.values() for name in axis.profiles)]
