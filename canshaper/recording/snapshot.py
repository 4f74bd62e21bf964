"""The state of a controller at a moment, to go back to it.

``copy.deepcopy`` would copy the DBC files too. Here every object of ours that can be reached is
noted with what it holds, and gets that back. What a deployment file or a DBC file says does not
change, and is left out.
"""

from collections import deque
from functools import partial
from types import BuiltinMethodType, FunctionType, MethodType
from typing import Any

from canshaper.codec import e2e, flags, layout, signals
from canshaper.machine import database, inputs

OURS = "canshaper."
# Made with a deployment, and never changed.
FIXED = (
    "canshaper.config.",
    *(module.__name__ for module in (database, e2e, flags, inputs, layout, signals)),
)


class Snapshot:
    """What everything reachable from an object holds now.

    Args:
        root: an object of ours.
    """

    def __init__(self, root: object) -> None:
        self._attributes: list[tuple[Any, dict[str, Any]]] = []
        self._containers: list[tuple[Any, Any]] = []
        seen: set[int] = set()
        waiting: list[Any] = [root]
        while waiting:
            one = waiting.pop()
            if id(one) in seen:
                continue
            seen.add(id(one))
            kind = type(one)
            if kind is dict:
                self._containers.append((one, dict(one)))
                waiting += [v for v in one.values() if type(v) not in _ATOMS]
            elif kind in _LISTS:
                self._containers.append((one, kind(one) if kind is not deque else list(one)))
                waiting += [v for v in one if type(v) not in _ATOMS]
            elif kind is tuple:
                waiting += [v for v in one if type(v) not in _ATOMS]
            elif kind is MethodType:
                waiting.append(one.__self__)
            elif kind is partial:
                waiting += [one.func, *one.args]
            elif kind is FunctionType:
                waiting += [cell.cell_contents for cell in one.__closure__ or ()]
            elif kind.__module__.startswith(OURS) and not kind.__module__.startswith(FIXED):
                held = _held(one)
                if held:
                    self._attributes.append((one, held))
                    waiting += [v for v in held.values() if type(v) not in _ATOMS]

    def restore(self) -> None:
        """Give everything back what it held."""
        for one, held in self._attributes:
            for name, value in held.items():
                object.__setattr__(one, name, value)
        for one, content in self._containers:
            one.clear()
            if type(one) in (dict, set):
                one.update(content)
            else:
                one.extend(content)


_ATOMS = frozenset((int, float, str, bytes, bool, type(None), complex, BuiltinMethodType))
_LISTS = frozenset((list, deque, set))
_SLOTS: dict[type, tuple[str, ...]] = {}


def _held(one: Any) -> dict[str, Any]:
    """Attributes of an object; none of a class, or of a number with a name."""
    kind = type(one)
    if (names := _SLOTS.get(kind)) is None:
        found = [n for k in kind.__mro__ for n in _slots(k)]
        names = _SLOTS[kind] = tuple(found)
    held = (
        dict(getattr(one, "__dict__", ())) if not isinstance(one, (type, int, str, tuple)) else {}
    )
    for name in names:
        if hasattr(one, name):
            held[name] = getattr(one, name)
    return held


def _slots(kind: type) -> tuple[str, ...]:
    found = kind.__dict__.get("__slots__", ())
    return (found,) if isinstance(found, str) else tuple(found)
