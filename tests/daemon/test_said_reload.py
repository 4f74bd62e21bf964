"""Reports of a daemon on a reload, and the state of its ports after it."""

import os
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from canshaper.bus.port import ListeningPort
from canshaper.codec.frame import FrameFault
from canshaper.daemon.daemon import Daemon
from canshaper.daemon.ports import open_ports
from canshaper.daemon.reloads import Reloads
from canshaper.errors import BusError
from canshaper.machine.binding import load_deployment
from tests.daemon.bench import BUS, SECOND, Bench, FakePort, at
from tests.daemon.diary import SECOND_TICKS, VALVES, Diary
from tests.rigs.forwarder import TICK_NS


def test_a_reload_is_put_to_work_behind_neutral_and_at_once(
    bench: Bench, diary: Diary, log: Callable[[str], list[str]]
) -> None:
    """The manager knows while it lasts; the next tick does not wait for a bus that is not new."""
    diary.run(80, {9: bench.reload})
    (tick,) = {tick for tick, line in diary.lines if line == "reloading"}
    during = [line for at, line in diary.lines if at == tick]
    done = ["black box begins", "ready: reload applied", "freeze"]
    assert during == [*VALVES, "reloading", *VALVES, *done]
    assert diary.starts[tick + 1] == diary.starts[tick]
    assert log("reload=") == [f"INFO reload=applied file={bench.file}"]
    assert [at for at, _ in diary.statuses()] == [0, tick + 1 + SECOND_TICKS]


def test_a_reload_that_is_refused_changes_nothing_and_people_can_read_why(
    bench: Bench, diary: Diary
) -> None:
    """For a second, before the line says again how things are; deadlines stay as they were."""

    def opening(channel: str) -> None:
        if channel == "vcan1":
            raise BusError("bus two: cannot open: no such adapter")

    bench.opening = opening
    diary.run(80, {9: lambda: bench.reload(BUS, SECOND)})
    (tick,) = {tick for tick, line in diary.lines if line == "reloading"}
    during = [line for at, line in diary.lines if at == tick]
    why = "reload refused: bus two: cannot open: no such adapter"
    assert during == [*VALVES, "reloading", "ready: as before", f"status: {why}"]
    assert [at for at, _ in diary.statuses()] == [0, tick, tick + SECOND_TICKS]
    assert diary.starts == [n * TICK_NS for n in range(81)]


# -- buses of a reload -----------------------------------------------------------------------------


def test_a_port_that_stays_open_gets_what_it_is_for_now(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    watched: list[Any] = []
    monkeypatch.setattr(FakePort, "watch", lambda _, name, ids: watched.append((name, ids)))
    at(bench, {9: lambda: bench.reload("timeout_ms: 100 #", "timeout_ms: 120 #")}, last=40)
    ((name, ids),) = watched
    routes = load_deployment(bench.file).routing.buses["crane"]
    assert (name, ids.sent, ids.claims) == ("crane", routes.sent, routes.claims)


@pytest.mark.parametrize("at_start", [True, False])
def test_of_buses_that_do_not_all_open_none_stays_open_that_was_not(
    bench: Bench, at_start: bool
) -> None:
    three = f"{SECOND}\n  three: {{ interface: socketcan, channel: vcan2 }}"

    def opening(channel: str) -> None:
        if channel == "vcan2":
            raise BusError("bus three: cannot open")

    bench.opening = opening
    if at_start:
        bench.file.write_text(bench.text.replace(BUS, three, 1), encoding="utf-8")
        with pytest.raises(BusError, match="bus three"):
            Daemon(lambda: load_deployment(bench.file))
        assert [port.closed for port in bench.ports] == [True, True]
    else:
        closed: list[tuple[str, bool]] = []
        see = lambda: closed.extend((port.channel, port.closed) for port in bench.ports)  # noqa: E731
        at(bench, {9: lambda: bench.reload(BUS, three), 30: see}, last=30)
        assert closed == [("vcan0", False), ("vcan1", True)]


def test_a_fault_of_a_bus_that_a_reload_opened_is_counted(
    bench: Bench, log: Callable[[str], list[str]]
) -> None:
    fails = lambda: bench.faults[1](FrameFault.ERROR_FRAME)  # noqa: E731
    at(bench, {9: lambda: bench.reload(BUS, SECOND), 30: fails}, last=40)
    assert log("fault=ERROR_FRAME")
    routes = load_deployment(bench.file).routing.buses
    assert [ids.sent for ids in bench.routes[1:]] == [routes["two"].sent]


def test_who_takes_part_has_the_port_itself_and_who_listens_one_around_it(bench: Bench) -> None:
    """No step more on the way of a frame than there has to be."""
    deployment = load_deployment(bench.file)
    (port,) = open_ports(deployment, {}, lambda _fault: None).values()
    assert port is bench.ports[0]
    listening = replace(deployment, listen_only=True)
    (port,) = open_ports(listening, {}, lambda _fault: None).values()
    assert isinstance(port, ListeningPort)
    opened = {listening.config.buses["crane"]: port}
    assert open_ports(listening, opened, lambda _fault: None) == {"crane": port}


def test_what_was_read_is_taken_in_neutral_alone() -> None:
    """It may need modules that are not loaded, and it is large: no axis moves meanwhile."""
    refused: list[str] = []
    reloads = Reloads(lambda: 1 / 0, refused.append)  # type: ignore[arg-type,return-value]
    reloads.request()
    reloads.step(neutral=True)
    assert reloads._reading
    os.waitid(os.P_PID, reloads._reading._pid, os.WEXITED | os.WNOWAIT)
    reloads.step(neutral=False)
    assert not refused
    reloads.step(neutral=True)
    assert refused == ["ZeroDivisionError: division by zero"]
