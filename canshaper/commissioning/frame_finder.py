"""Which input of a deployment a frame is, for tools that only listen: found as the daemon does."""

from collections.abc import Iterable, Mapping
from typing import Generic, TypeVar

from canshaper.codec.frame import Frame, FrameFault
from canshaper.codec.identifier import group_of
from canshaper.config.bus import Bus
from canshaper.machine.inputs import BoundInput
from canshaper.protocols.j1939.groups import AnySource, ReceivedGroup

_Input = TypeVar("_Input", bound=BoundInput)


class InputFinder(Generic[_Input]):
    """Finds inputs by identifier, those of J1939 by group and source, whatever their priority.

    Of a message that may come from any address the first one that sends is used, until it is
    silent for ``timeout_ms``.

    Args:
        buses: buses of the machine by name.
        inputs: those of its inputs that are looked for.
    """

    def __init__(self, buses: Mapping[str, Bus], inputs: Iterable[_Input]) -> None:
        self._by_key: dict[tuple[str, int, bool], _Input] = {}
        self._by_group: dict[tuple[str, int], ReceivedGroup] = {}
        self._input: _Input | None = None
        for bound in inputs:
            if not bound.by_group:
                self._by_key |= dict.fromkeys(bound.keys, bound)
                continue
            bus, can_id, _ = bound.key
            node = buses[bus].j1939
            own = node.address if node else None
            group = self._by_group.setdefault((bus, group_of(can_id)), ReceivedGroup(own))
            noted = _Noted(self, bound)
            if bound.any_source:
                timeout_ns = bound.config.timeout_ms * 1_000_000
                group.rest = AnySource(bus, bound.message.name, noted, timeout_ns)
            else:
                group.of[can_id & 0xFF] = noted

    def find(self, frame: Frame, now_ns: int) -> _Input | None:
        """Return the input that a frame is of, or None; ``now_ns``: its arrival, of any clock."""
        if (bound := self._by_key.get(frame[:3])) is not None:
            return bound
        self._input = None
        if frame.extended and (group := self._by_group.get((frame.bus, group_of(frame.can_id)))):
            group.receive(frame, now_ns)
        return self._input

    def note(self, bound: _Input) -> None:
        """Note that the present frame is of this input."""
        self._input = bound


class _Noted(Generic[_Input]):
    """An input that keeps nothing, but notes that the frame is its own."""

    def __init__(self, finder: InputFinder[_Input], bound: _Input) -> None:
        self._finder = finder
        self._bound = bound

    def receive(self, _data: bytes, _arrived_ns: int, /) -> FrameFault:
        """Note it."""
        self._finder.note(self._bound)
        return FrameFault.NONE

    def invalidate(self) -> None:
        """Do nothing: no state is kept."""
