"""Range check shared by the parameter classes of the simulated machine."""

from collections.abc import Mapping
from typing import Any

from canshaper.errors import DesignError


def check_ranges(owner: str, values: Any, allowed: Mapping[str, tuple[float, float]]) -> None:
    """Refuse the first attribute of `values` outside its range, and every value that is no number.

    Args:
        owner: what is described, for the message, such as "valve".
        values: the object whose attributes are checked.
        allowed: attribute name -> (lowest, highest) value.

    Raises:
        DesignError: names owner, attribute, value and the allowed range.
    """
    for name, (low, high) in allowed.items():
        value = getattr(values, name)
        if not low <= value <= high:  # not-a-number compares false and is refused too
            raise DesignError(f"{owner}: {name}: expected {low} .. {high}, got {value}")
