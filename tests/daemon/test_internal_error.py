"""An exception of the program: neutral valves, a reason with its place, an orderly end."""

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.codec.velocity import ValveCodec
from canshaper.controller.axis_control import AxisControl
from canshaper.controller.controller import Controller
from canshaper.daemon.daemon import Daemon
from canshaper.errors import InternalError, raised
from canshaper.machine.binding import load_deployment
from canshaper.shaping.states import Reason, State
from tests.daemon.bench import Bench
from tests.rigs.forwarder import Rig

TICK, LATER = 60, 120
Log = Callable[[], list[str]]


def broken(*_arguments: Any) -> Any:
    raise ZeroDivisionError("planted,\n  in two lines")


def driven(bench: Bench, plant: Callable[[], None], folder: Path | None = None) -> None:
    """Full deflection of slew; something is planted in motion."""

    def script(number: int) -> None:
        bench.joysticks(Slew=1000 if number > 10 else 0)
        if number == TICK:
            plant()
        if number == LATER:
            bench.stop()

    bench.script = script
    Daemon(lambda: load_deployment(bench.file), folder).run()


@pytest.mark.parametrize("where", ["tick", "receive", "on_bus_off"])
def test_an_exception_ends_with_neutral_valves_and_its_place(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, log: Log, where: str, tmp_path: Path
) -> None:
    def plant() -> None:
        assert any(f.data[0] for f in bench.sent if f.can_id == 0x200)
        bench.sent.clear()
        for port in bench.ports:
            port.state = "down" if where == "on_bus_off" else port.state  # type: ignore[assignment]
        monkeypatch.setattr(Controller, where, broken)

    if where == "on_bus_off":
        monkeypatch.setattr("canshaper.daemon.daemon.OFF_BUS", frozenset(["down"]))
    (folder := tmp_path / "boxes").mkdir()
    with pytest.raises(InternalError, match="ZeroDivisionError: planted, in two lines ") as end:
        driven(bench, plant, folder)
    text = str(end.value)
    assert text.startswith("reason=INTERNAL_ERROR ZeroDivisionError")
    assert f"{__file__}:" in text
    assert f"CRITICAL failed {text}" in log()
    assert log()[-1] == "INFO stopped valves=neutral"
    last = {frame.can_id: frame.data[0] for frame in bench.sent}
    assert [last[valve] for valve in (0x200, 0x201, 0x202)] == [0, 0, 0]
    assert all(port.closed for port in bench.ports)
    (box,) = folder.iterdir()
    assert json.loads(zipfile.ZipFile(box).read("about.json"))["why"] == text


@pytest.mark.parametrize("both", [False, True])
def test_neutral_that_cannot_be_made_hides_no_failure_and_keeps_the_end_orderly(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, log: Log, both: bool
) -> None:
    def silent(*_arguments: Any) -> Any:
        raise LookupError("no neutral")

    def plant() -> None:
        monkeypatch.setattr(Controller, "neutral_frames", silent)
        if both:
            monkeypatch.setattr(Controller, "tick", broken)

    first = "ZeroDivisionError: planted" if both else "LookupError: no neutral"
    with pytest.raises(InternalError, match=f"^reason=INTERNAL_ERROR {first}"):
        driven(bench, plant)
    assert [
        line for line in log() if line.startswith(f"CRITICAL failed reason=INTERNAL_ERROR {first}")
    ]
    assert log()[-1] == "INFO stopped valves=not-sent"
    assert all(port.closed for port in bench.ports)


def test_a_valve_without_neutral_costs_the_others_nothing(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, log: Log
) -> None:
    def put(control: AxisControl, steps: int) -> None:
        if control.bound.name == "slew":
            raise LookupError("no neutral")
        sound(control, steps)

    def plant() -> None:
        bench.sent.clear()
        monkeypatch.setattr(AxisControl, "put", put)
        monkeypatch.setattr(Controller, "tick", broken)

    sound = AxisControl.put
    with pytest.raises(InternalError, match="ZeroDivisionError"):
        driven(bench, plant)
    assert {frame.can_id for frame in bench.sent} >= {0x201, 0x202}
    assert 0x200 not in {frame.can_id for frame in bench.sent}
    assert log()[-1] == "INFO stopped valves=not-sent"


def test_a_last_frame_that_is_refused_is_in_the_log(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, log: Log
) -> None:
    def plant() -> None:
        monkeypatch.setattr(AxisControl, "put", lambda control, _: sound(control, 9))

    sound = AxisControl.put
    driven(bench, plant)
    refused = [line for line in log() if "output=refused" in line]
    assert [line.split()[-2:] for line in refused] == [
        [f"axis={name}", "limit=neutral"] for name in ("slew", "near_far", "lift")
    ]
    assert log()[-1] == "INFO stopped valves=not-sent"


def test_a_setpoint_that_cannot_be_encoded_is_neutral_and_the_loop_goes_on(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, log: Log
) -> None:
    put = ValveCodec.put
    beyond = False

    def planted(codec: ValveCodec, raw: dict[str, int], steps: int) -> None:
        put(codec, raw, codec.steps + 1 if beyond and steps else steps)

    def plant() -> None:
        nonlocal beyond
        beyond = True
        bench.sent.clear()

    monkeypatch.setattr(ValveCodec, "put", planted)
    driven(bench, plant)
    sent = [frame.data[0] for frame in bench.sent if frame.can_id == 0x200]
    assert len(sent) >= LATER - TICK
    assert not any(sent)
    lines = [line for line in log() if "axis=slew" in line]
    why = "WARNING axis=slew state=TRIPPED from=ACTIVE reason=OUTPUT_INVALID error=ValueError: "
    assert lines[-1].startswith(f"{why}valve command: expected up to +-125 steps, got 126 (")
    assert "velocity.py:" in lines[-1]


def test_a_setpoint_beyond_full_trips_its_axis_only(rig: Rig) -> None:
    rig.run(3)
    rig.run(50, Slew=1000, Lift=1000)
    axis = rig.controller.axes["slew"].axis
    command = axis.command

    def beyond(*arguments: Any, **keys: Any) -> Any:
        transition = command(*arguments, **keys)
        axis.output.steps = 126
        return transition

    axis.command = beyond  # type: ignore[method-assign]
    sent = rig.run(1, Slew=1000, Lift=1000)
    assert sent["SlewCommand"]["Velocity"] == 0
    assert sent["LiftCommand"]["Velocity"] > 50
    assert (axis.state, axis.reason) == (State.TRIPPED, Reason.OUTPUT_INVALID)
    assert (axis.output.steps, axis.output.setpoint, axis.output.applied) == (0, 0.0, 0.0)


def test_run_ends_with_an_exit_code_after_which_it_is_started_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def failed(*_arguments: Any) -> Any:
        raise InternalError("reason=INTERNAL_ERROR planted")

    monkeypatch.setattr("canshaper.daemon.daemon.Daemon", failed)
    shown = CliRunner().invoke(app, ["run", "config/forwarder.yaml"])
    assert (shown.exit_code, shown.stderr.strip()) == (1, "reason=INTERNAL_ERROR planted")


def test_an_exception_that_was_never_raised_has_no_place() -> None:
    assert raised(KeyError("one")) == "KeyError: 'one'"
