"""States of the CAN controller in error frames: bus off, passive, restarted."""

import pytest

from canshaper.bus.interface import PROBE_NS
from canshaper.codec.frame import BusState, FrameFault
from tests.bus.raw_line import VALVE, Line, message

# linux/can/error.h
BUS_OFF, RESTARTED, CONTROLLER = 0x40, 0x100, 0x4
RX_OVERFLOW, TX_OVERFLOW, TX_WARNING = 0x01, 0x02, 0x08
RX_PASSIVE, TX_PASSIVE, ACTIVE = 0x10, 0x20, 0x40


def test_bus_off_sends_nothing_more(line: Line) -> None:
    line.error(BUS_OFF)
    assert line.received() == []
    assert line.port.state is BusState.BUS_OFF
    assert line.faults == [FrameFault.BUS_OFF]
    for _ in range(24):
        assert line.unconfirmed() == 0
    assert line.sent() == []


@pytest.mark.parametrize(("kind", "data"), [(RESTARTED, 0), (CONTROLLER, ACTIVE)])
def test_a_restarted_controller_sends_at_once(line: Line, kind: int, data: int) -> None:
    line.error(BUS_OFF)
    line.error(kind, data)
    assert line.received() == []
    assert line.port.state is BusState.UP
    assert line.unconfirmed() == 3


def test_bus_off_stays_bus_off_while_probes_do_not_come_back(line: Line) -> None:
    line.error(BUS_OFF)
    line.received()
    for _ in range(5):
        line.now_ns += PROBE_NS
        assert line.unconfirmed() == 1
        assert line.port.state is BusState.BUS_OFF
    line.confirm(VALVE)  # the controller was restarted, unseen
    line.received()
    assert line.port.state is BusState.UP


@pytest.mark.parametrize("passive", [RX_PASSIVE, TX_PASSIVE, RX_PASSIVE | TX_PASSIVE])
@pytest.mark.parametrize("better", [ACTIVE, TX_WARNING])
def test_a_passive_controller_still_sends(line: Line, passive: int, better: int) -> None:
    line.error(CONTROLLER, passive)
    line.received()
    assert line.port.state is BusState.PASSIVE
    assert line.faults == [FrameFault.BUS_PASSIVE]
    assert line.port.send(VALVE)
    line.confirm(VALVE)
    line.received()
    assert line.port.state is BusState.PASSIVE  # a frame got through all the same
    line.error(CONTROLLER, better)
    line.received()
    assert line.port.state is BusState.UP


@pytest.mark.parametrize("kind", [0x8, 0x80, 0x200])
def test_the_state_of_a_controller_counts_in_its_own_class_only(line: Line, kind: int) -> None:
    """In other classes the byte means something else."""
    line.error(kind, TX_PASSIVE)
    line.received()
    assert line.port.state is BusState.UP
    assert line.faults == [FrameFault.ERROR_FRAME]


@pytest.mark.parametrize("state", [BusState.PASSIVE, BusState.BUS_OFF, BusState.NOT_CONFIRMED])
def test_a_frame_that_is_received_does_not_show_that_ours_get_through(
    line: Line, state: BusState
) -> None:
    if state is BusState.NOT_CONFIRMED:
        line.unconfirmed()
    else:
        line.error(*((BUS_OFF,) if state is BusState.BUS_OFF else (CONTROLLER, TX_PASSIVE)))
    line.put(message(0x110))
    line.received()
    line.put(message(0x110))
    assert len(line.received()) == 1
    assert line.port.state is state


def test_passive_is_less_than_bus_off_and_than_not_confirmed(line: Line) -> None:
    """A node that is alone on its bus is passive because no one acknowledges its frames."""
    line.unconfirmed()
    line.error(CONTROLLER, TX_PASSIVE)
    line.received()
    assert line.port.state is BusState.NOT_CONFIRMED
    line.error(BUS_OFF)
    line.error(CONTROLLER, TX_PASSIVE)
    line.received()
    assert line.port.state is BusState.BUS_OFF
    assert line.unconfirmed() == 0


@pytest.mark.parametrize(
    ("data", "fault"),
    [(RX_OVERFLOW, FrameFault.FRAMES_LOST), (TX_OVERFLOW, FrameFault.ERROR_FRAME)],
)
def test_an_overflow_of_the_controller_is_no_recovery(
    line: Line, data: int, fault: FrameFault
) -> None:
    line.unconfirmed()
    line.error(CONTROLLER, data)
    line.received()
    assert line.port.state is BusState.NOT_CONFIRMED
    assert line.faults[-1] is fault
    assert line.unconfirmed() == 0
