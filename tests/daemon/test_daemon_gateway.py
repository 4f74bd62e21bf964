"""The daemon as a gateway: when it passes frames on, and what fails."""

from collections.abc import Callable, Mapping
from typing import Any

import pytest

from canshaper.codec.frame import FrameFault
from canshaper.daemon import gateway
from canshaper.errors import BusError
from canshaper.gate.cycle import FramePort, FrameProcessor, Standstill, receive_waiting
from canshaper.machine.deployment import Deployment
from tests.daemon.bench import Bench, at


class CountingGateway:
    """Counts calls of a gateway between its ticks; it has received joystick frames by then."""

    def __init__(
        self, bench: Bench, deployment: Deployment, on_fault: Callable[[FrameFault], None]
    ) -> None:
        assert deployment.config.gateway
        self.waits = self.passes = self.checks = 0
        self.closed = 0
        self.on_fault = on_fault
        self._bench = bench

    def wait(
        self,
        seconds: float,
        processor: FrameProcessor,
        ports: Mapping[str, FramePort],
        standstill: Standstill,
    ) -> None:
        self.waits += 1
        self._bench.sleep(seconds / 2)
        assert not standstill.over(self._bench.now_ns)
        receive_waiting(processor, ports, self._bench.now_ns, standstill)
        self._bench.sleep(seconds / 2)

    def pass_others(self) -> int:
        self.passes += 1
        return 0

    def check(self, now_ns: int, *, neutral: bool) -> None:
        assert (now_ns, neutral) == (self._bench.now_ns, True)
        self.checks += 1

    def close(self) -> None:
        self.closed += 1


@pytest.fixture
def lines(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> list[CountingGateway]:
    """The bench's machine has a gateway; what stands in its line, one after the other."""
    bench.become("gateway-forwarder")
    lines: list[CountingGateway] = []

    def in_line(*arguments: Any) -> CountingGateway:
        lines.append(CountingGateway(bench, *arguments))
        return lines[-1]

    monkeypatch.setattr(gateway, "InlineGateway", in_line)
    return lines


def test_a_gateway_waits_passes_on_and_checks_in_every_tick(
    bench: Bench, lines: list[CountingGateway]
) -> None:
    at(bench, {5: bench.reload})
    assert [one.closed for one in lines] == [1, 1]  # the old one, and the last one at the end
    assert sum(one.passes for one in lines) == sum(one.checks for one in lines) == 21
    assert sum(one.waits for one in lines) == 19  # a reload begins with a tick


def test_a_joystick_frame_leaves_a_gateway_before_the_next_tick(
    bench: Bench, lines: list[CountingGateway]
) -> None:
    """Half a tick after the one before; it has waited on the first bus until then."""
    left: list[int] = []

    def comes_later() -> None:
        frame = bench.rig.joystick("JoystickLeft")
        before = len(bench.sent)
        bench.ports[0].waiting.append((bench.now_ns + 9_000_000, frame))
        left.append(before)

    def counts() -> None:
        left.append(sum(f.can_id == frame_id for f in bench.sent[left[0] :]))

    frame_id = bench.rig.messages["JoystickLeft"].frame_id
    bench.script = lambda number: None
    acts = {5: comes_later, 6: counts, 8: bench.stop}
    bench.run(lambda number: acts.get(number, lambda: None)())
    assert len(lines) == 1
    assert left[1] == 1


def test_a_fault_of_a_gateway_is_counted(
    bench: Bench, lines: list[CountingGateway], log: Callable[[], list[str]]
) -> None:
    at(bench, {5: lambda: lines[0].on_fault(FrameFault.SEND_FAILED)})
    assert any("fault=SEND_FAILED" in line for line in log())


def test_a_line_that_cannot_be_opened_leaves_the_one_before(
    bench: Bench,
    lines: list[CountingGateway],
    monkeypatch: pytest.MonkeyPatch,
    log: Callable[[], list[str]],
) -> None:
    """A port that was opened for it is closed again; those from before are not."""

    def cannot(*_: object) -> None:
        raise BusError("gateway: cannot open vcan0 and vcan9: no such device")

    def reloads() -> None:
        monkeypatch.setattr(gateway, "InlineGateway", cannot)
        bench.reload("channel: vcan1", "channel: vcan9")

    closed: list[tuple[str, bool]] = []
    ends = lambda: closed.extend((p.channel, p.closed) for p in bench.ports)  # noqa: E731
    at(bench, {5: reloads, 19: ends})
    assert [line for line in log() if "refused" in line]
    assert closed == [("vcan0", False), ("vcan1", False), ("vcan9", True)]
    assert [one.closed for one in lines] == [1]
