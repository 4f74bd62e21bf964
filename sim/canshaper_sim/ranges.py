"""Range check shared by the parameter classes of the simulated machine."""

from collections.abc import Mapping
from typing import Any

from canshaper.errors import DesignError


def check_ranges(owner: str, values: Any, allowed: Mapping[str, tuple[float, float]]) -> None:
    """Refuse the first attribute of `values` that is outside its range or not a number.

    Args:
        owner: name of the described thing for the message, such as "valve".
        values: the object whose attributes are checked.
        allowed: attribute name -> (lowest, highest) value.

    Raises:
        DesignError: the message names owner, attribute, value and allowed range.
    """
    for name, (low, high) in allowed.items():
        value = getattr(values, name)
        if not low <= value <= high:  # not-a-number compares false and is refused too
            raise DesignError(f"{owner}: {name}: expected {low} .. {high}, got {value}")
