"""An input from whatever address: which one counts, and when another one takes over."""

from types import SimpleNamespace
from typing import Any

import pytest

from canshaper.codec.frame import Frame, FrameFault
from canshaper.inputs.stops import StopCauses
from canshaper.protocols.j1939.groups import AnySource, SourceEvent

TIMEOUT_NS = 100
FIRST, SECOND = 0x33, 0x34


class Counted:
    """An input: what it receives, and how often it is invalidated."""

    def __init__(self) -> None:
        self.received: list[tuple[bytes, int]] = []
        self.invalidated = 0

    def receive(self, data: bytes, arrived_ns: int) -> FrameFault:
        self.received.append((data, arrived_ns))
        return FrameFault.NONE

    def invalidate(self) -> None:
        self.invalidated += 1


@pytest.fixture
def joystick() -> Counted:
    return Counted()


@pytest.fixture
def source(joystick: Counted) -> AnySource:
    return AnySource("crane", "BJM1", joystick, TIMEOUT_NS)


def frame(address: int) -> Frame:
    return Frame("crane", 0x0CFDD600 | address, True, bytes((address,)))


def test_the_first_address_invalidates_nothing(source: AnySource, joystick: Counted) -> None:
    assert source.receive(frame(FIRST), 7) is FrameFault.NONE
    assert joystick.received == [(bytes((FIRST,)), 7)]
    assert joystick.invalidated == 0


def test_an_address_that_takes_over_invalidates_the_input_and_its_axes_once(
    joystick: Counted,
) -> None:
    stops = [StopCauses(), StopCauses()]
    controls: Any = [SimpleNamespace(stops=one) for one in stops]
    source = AnySource("crane", "BJM1", joystick, TIMEOUT_NS, controls)
    source.receive(frame(FIRST), 0)
    assert source.receive(frame(SECOND), TIMEOUT_NS) is FrameFault.SECOND_SENDER
    assert [joystick.invalidated, *(one.invalid for one in stops)] == [0, False, False]
    for now_ns in (TIMEOUT_NS + 1, TIMEOUT_NS + 2):
        assert source.receive(frame(SECOND), now_ns) is FrameFault.NONE
        assert [joystick.invalidated, *(one.invalid for one in stops)] == [1, True, True]
    assert [data for data, _ in joystick.received] == [bytes((a,)) for a in (FIRST, SECOND, SECOND)]


def test_invalidate_invalidates_the_input(source: AnySource, joystick: Counted) -> None:
    source.invalidate()
    assert joystick.invalidated == 1


def test_after_each_change_of_the_address_a_second_one_is_named_again(source: AnySource) -> None:
    steps = (  # (time, address)
        (0, FIRST), (1, SECOND),
        (200, SECOND), (201, FIRST),
        (400, FIRST), (401, SECOND), (402, SECOND),
    )  # fmt: skip
    for now_ns, address in steps:
        source.receive(frame(address), now_ns)
    assert source.events == [
        SourceEvent("crane", "BJM1", address, received)
        for address, received in (
            (FIRST, FIRST), (SECOND, FIRST),
            (SECOND, SECOND), (FIRST, SECOND),
            (FIRST, FIRST), (SECOND, FIRST),
        )
    ]  # fmt: skip
