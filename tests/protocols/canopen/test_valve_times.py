"""The state machine of a valve by itself: what it commands at the nanosecond of each limit."""

import pytest

from canshaper.machine.binding import load_deployment
from canshaper.protocols.canopen.network import ValveControl
from canshaper.shaping.states import Reason
from tests.rigs.canopen import ACTIVE, DISABLED, FILE, HOLD, INIT, RESET
from tests.rigs.files import ROOT

MS = 1_000_000
NOT_READY = 0  # status word
GAVE_UP = 2000 * MS + 1
UP = [(0, INIT, INIT), (50 * MS, INIT, DISABLED), (100 * MS, DISABLED, HOLD)]
UP += [(150 * MS, HOLD, ACTIVE), (200 * MS, ACTIVE, ACTIVE)]
FALLEN = 250 * MS  # when the valve is seen in another state than ACTIVE


class Valve:
    """The valve of the slew axis, without the axis."""

    def __init__(self) -> None:
        axis = load_deployment(ROOT / "config" / FILE).axes["slew"]
        assert axis.status_word is not None
        self.sender = axis.valve.message.sender()
        self.control = ValveControl(axis.status_word, "ControlWord", self.sender)

    def word(self, now_ns: int, status: int) -> int:
        """Control word of the tick at that time, with a status word that has just come."""
        self.control.receive(status.to_bytes(2, "little"), now_ns)
        self.control.gate(True, now_ns)
        return self.sender.frame().data[0]

    def active(self) -> "Valve":
        """Brought to work."""
        assert [self.word(at_ns, status) for at_ns, status, _ in UP] == [word for *_, word in UP]
        return self


@pytest.fixture
def valve() -> Valve:
    return Valve()


@pytest.mark.parametrize(
    "ticks",
    [
        pytest.param(
            [(0, INIT, INIT), (50 * MS - 1, INIT, INIT), (50 * MS, INIT, DISABLED)],
            id="a step is 50 ms after the first tick",
        ),
        pytest.param(
            [*UP[:2], (60 * MS, DISABLED, DISABLED), (100 * MS, DISABLED, HOLD)],
            id="a step is 50 ms after the tick of the step before",
        ),
        pytest.param(
            [
                *UP,
                (FALLEN, DISABLED, INIT),
                (FALLEN + 10 * MS, INIT, INIT),
                (FALLEN + 50 * MS, INIT, DISABLED),
            ],
            id="a step is 50 ms after the tick of a new beginning",
        ),
        pytest.param(
            [
                *UP[:2],
                (100 * MS, INIT, DISABLED),
                (2050 * MS, INIT, DISABLED),
                (2050 * MS + 1, INIT, INIT),
            ],
            id="a state that is not reached is waited for two seconds",
        ),
        pytest.param(
            [(0, NOT_READY, INIT), (2000 * MS, NOT_READY, INIT), (2000 * MS + 1, NOT_READY, RESET)],
            id="a valve that is not ready boots for two seconds, then it has a fault",
        ),
        pytest.param(
            [
                (0, NOT_READY, INIT),
                (GAVE_UP, NOT_READY, RESET),
                (GAVE_UP + 10 * MS, NOT_READY, RESET),
                (GAVE_UP + 50 * MS - 1, NOT_READY, RESET),
                (GAVE_UP + 50 * MS, NOT_READY, HOLD),
            ],
            id="the ready bit has its edge 50 ms after the reset",
        ),
        pytest.param(
            [
                (0, NOT_READY, INIT),
                (GAVE_UP, NOT_READY, RESET),
                (GAVE_UP + 50 * MS, NOT_READY, HOLD),
                (GAVE_UP + 60 * MS, HOLD, HOLD),
                (GAVE_UP + 100 * MS, HOLD, ACTIVE),
            ],
            id="a valve without its fault is active 50 ms after the edge",
        ),
        pytest.param(
            [
                (0, NOT_READY, INIT),
                (GAVE_UP, NOT_READY, RESET),
                (GAVE_UP + 50 * MS, NOT_READY, HOLD),
                (GAVE_UP + 500 * MS - 1, NOT_READY, HOLD),
                (GAVE_UP + 500 * MS, NOT_READY, RESET),
            ],
            id="a fault that stays is reset every 500 ms",
        ),
    ],
)
def test_control_word(valve: Valve, ticks: list[tuple[int, int, int]]) -> None:
    assert [valve.word(at_ns, status) for at_ns, status, _ in ticks] == [w for *_, w in ticks]


@pytest.mark.parametrize(("late_ns", "reason"), [(0, None), (1, Reason.VALVE_FAULT)])
def test_a_status_word_counts_for_its_timeout_and_no_longer(
    valve: Valve, late_ns: int, reason: Reason | None
) -> None:
    at_ns = UP[-1][0]
    assert valve.active().control.gate(False, at_ns + 300 * MS + late_ns) is reason
    assert valve.sender.frame().data[0] == (INIT if reason else ACTIVE)


def test_after_invalidation_no_status_word_has_been_received(valve: Valve) -> None:
    assert valve.active().control.received_ns == UP[-1][0]
    valve.control.invalidate()
    assert valve.control.received_ns is None
