"""Frames that are old after a reload: from before it, on whatever bus, and the time it took."""

from collections.abc import Callable
from typing import Any

import pytest

from canshaper.daemon import daemon as module
from canshaper.daemon import ports as service_ports
from tests.daemon.bench import Bench

READY = ("READY", "JOYSTICK_NEUTRAL")


def states_by_tick(bench: Bench, last: int) -> Callable[[int], tuple[str, str]]:
    """State and reason of the slew axis by tick, of a run whose joysticks fall silent at last."""
    states: list[tuple[str, str]] = []

    def script(number: int) -> None:
        if number:
            states.append(bench.reported())
        if number <= last:
            bench.joysticks()
        if number == last:
            bench.reload("bitrate: 250000", "bitrate: 500000")
        if number == last + 20:
            bench.stop()

    bench.run(script)
    return states.__getitem__


@pytest.mark.parametrize("where", ["old", "new"])
def test_a_joystick_frame_that_waits_on_a_bus_that_is_opened_again_is_no_news(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    """In the old port before it closes, or in the new one while it is new."""
    sleep = bench.sleep

    def sleeping(seconds: float) -> None:
        sleep(seconds)
        if where == "new" and seconds == service_ports.ON_THE_BUS_S:
            bench.joysticks()

    def opening(_channel: str) -> None:
        if where == "old" and len(bench.ports) == 1:
            bench.joysticks()

    monkeypatch.setattr(bench, "sleep", sleeping)
    bench.opening = opening
    states = states_by_tick(bench, 9)
    assert states(8) == READY
    assert states(12) == ("NEUTRAL_WAIT", "JOYSTICK_TIMEOUT")


def test_a_reload_that_takes_long_is_a_standstill(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No bus is opened, yet what comes meanwhile has waited when the next tick reads it."""
    gated = module.GatedController

    def slow(*arguments: Any) -> Any:
        for _ in range(20 * (len(slept) > 0)):
            bench.joysticks()
            bench.sleep(0.02)
        slept.append(1)
        return gated(*arguments)

    slept: list[int] = []
    monkeypatch.setattr(module, "GatedController", slow)
    states: list[tuple[str, str]] = []

    def script(number: int) -> None:
        if number:
            states.append(bench.reported())
        if number < 10:
            bench.joysticks()
        if number == 9:
            bench.reload()
        if number == 20:
            bench.stop()

    bench.run(script)
    assert len(slept) == 2
    assert states[8] == READY
    assert states[12] == ("NEUTRAL_WAIT", "JOYSTICK_TIMEOUT")
