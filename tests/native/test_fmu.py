"""Units of FMI 3.0, validated and driven by fmpy: the demo through them is that of Python.

fmpy is in no environment of the quick tests: ``make test-exports``.
"""

import math
import shutil
import subprocess
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from canshaper.design.lockstep import Simulation
from canshaper.shaping.states import Reason, State
from canshaper_sim.axes import TIP_AXES
from canshaper_sim.hand import Hand
from canshaper_sim.operator import script_for
from canshaper_sim.plant import PlantNode
from canshaper_sim.valve_frames import CommandReader
from tests.cli.invocation import invoke
from tests.native.judge import needs_compiler
from tests.rigs.files import CONFIG, read

fmpy: Any = pytest.importorskip("fmpy", reason="fmpy is not installed: make test-exports")
from fmpy.fmi3 import FMU3Slave  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]
NAME = "forwarder-robust"
ROBUST = read(CONFIG / f"{NAME}.yaml")
TICK_S = ROBUST.config.tick_ms / 1000.0
SCRIPT = script_for(ROBUST, "demo")
NEAR_DEG = 0.01


@pytest.fixture(scope="module")
def units(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    needs_compiler()
    folder = tmp_path_factory.mktemp("units")
    made = {}
    for kind in ("controller", "plant"):
        options = ["export", f"{NAME}.yaml", "--fmu", kind, "--out", str(folder / kind)]
        done = invoke(*options)
        assert done.exit_code == 0, done.output
        made[kind] = folder / kind / f"{kind}.fmu"
        assert f"{kind}, with a binary for" in done.output
    return made


class Slave:
    """A unit that runs, its variables by name."""

    def __init__(self, path: Path, folder: Path) -> None:
        about = fmpy.read_model_description(str(path))
        self.variables = {one.name: one for one in about.modelVariables}
        self.said: list[str] = []
        unzipped = fmpy.extract(str(path), unzipdir=str(folder))
        name = about.coSimulation.modelIdentifier
        self.fmu = FMU3Slave(
            guid=about.instantiationToken, unzipDirectory=unzipped, modelIdentifier=name
        )
        self.fmu.instantiate(logMessage=lambda *said: self.said.append(said[-1].decode()))
        self.fmu.enterInitializationMode(startTime=0.0)
        self.fmu.exitInitializationMode()

    def _of(self, word: str, name: str) -> tuple[Any, list[int]]:
        variable = self.variables[name]
        type_ = {"Enumeration": "Int64"}.get(variable.type, variable.type)
        return getattr(self.fmu, f"{word}{type_}"), [variable.valueReference]

    def set(self, name: str, value: float) -> None:
        call, references = self._of("set", name)
        call(references, [value])

    def get(self, name: str) -> Any:
        call, references = self._of("get", name)
        return call(references)[0]

    def step(self, tick: float, length_s: float = TICK_S) -> None:
        self.fmu.doStep(currentCommunicationPoint=tick * TICK_S, communicationStepSize=length_s)


@contextmanager
def running(path: Path, folder: Path) -> Iterator[Slave]:
    slave = Slave(path, folder)
    yield slave
    slave.fmu.terminate()
    slave.fmu.freeInstance()


class Hands:
    """The joysticks of the script, as often as their messages come."""

    def __init__(self) -> None:
        self._hand = Hand(ROBUST)

    def move(self, slave: Slave, time_s: float) -> None:
        cycle_s = self._hand.cycle_ms / 1000.0
        held_s = math.floor(time_s / cycle_s + 1e-9) * cycle_s
        for axis in ROBUST.axes:
            slave.set(f"{axis}.demand", SCRIPT.command(axis, held_s))


def swing_deg(plant: PlantNode) -> tuple[float, float]:
    state = plant.crane.state
    return math.degrees(state.theta5_rad), math.degrees(state.theta6_rad)


@pytest.fixture(scope="module")
def expected() -> list[tuple[float, float]]:
    simulation = Simulation(ROBUST, SCRIPT)
    swings = [swing_deg(simulation.plant) for _ in simulation.ticks()]
    assert max(map(max, swings)) > 100.0 * NEAR_DEG
    return swings


def differ_deg(ones: list[tuple[float, float]], others: list[tuple[float, float]]) -> float:
    """The largest difference of a swing, of the whole drive and so of what is left at its end."""
    pairs = zip(ones, others, strict=True)
    return max(abs(a - b) for one, two in pairs for a, b in zip(one, two, strict=True))


@pytest.mark.parametrize("kind", ["controller", "plant"])
def test_fmpy_finds_no_fault(units: dict[str, Path], kind: str) -> None:
    assert validate_fmu(str(units[kind])) == []
    about = fmpy.read_model_description(str(units[kind]))
    assert [one.name for one in about.modelVariables if not one.description] == []
    numbers = [one for one in about.modelVariables if one.type == "Float64" and one.name != "time"]
    assert all(one.unit or one.declaredType for one in numbers)


def test_the_demo_through_the_controller(
    units: dict[str, Path], expected: list[tuple[float, float]], tmp_path: Path
) -> None:
    plant, hands, swings = PlantNode(ROBUST, listeners=False), Hands(), []
    senders = {name: axis.valve.message.sender() for name, axis in ROBUST.axes.items()}
    with running(units["controller"], tmp_path) as slave:
        for tick in range(len(expected)):
            hands.move(slave, tick * TICK_S)
            slave.set("crane.radius", plant.crane.state.radius_m)
            slave.step(tick)
            for name, sender in senders.items():
                reader = CommandReader(ROBUST, name)
                steps = reader.step * round(slave.get(f"{name}.command") * reader.full)
                raw = {ROBUST.axes[name].config.valve.signal: reader.zero + steps}
                plant.receive(sender.frame(raw))
            plant.advance(TICK_S)
            swings.append(swing_deg(plant))
    assert differ_deg(swings, expected) <= NEAR_DEG


def test_the_demo_through_both(
    units: dict[str, Path], expected: list[tuple[float, float]], tmp_path: Path
) -> None:
    swings, hands = [], Hands()
    with (
        running(units["controller"], tmp_path / "a") as controller,
        running(units["plant"], tmp_path / "b") as plant,
    ):
        for tick in range(len(expected)):
            hands.move(controller, tick * TICK_S)
            controller.set("crane.radius", plant.get("near_far.radius"))
            controller.step(tick)
            for axis in TIP_AXES:
                plant.set(f"{axis}.command", controller.get(f"{axis}.command"))
            plant.step(tick)
            across, along = plant.get("sway.across"), plant.get("sway.along")
            swings.append((math.degrees(across), math.degrees(along)))
    assert differ_deg(swings, expected) <= NEAR_DEG


def test_the_demo_with_the_plant_in_place_of_ours(
    units: dict[str, Path], expected: list[tuple[float, float]]
) -> None:
    simulation = Simulation(ROBUST, SCRIPT, unit=units["plant"])
    swings = [swing_deg(simulation.plant) for _ in simulation.ticks()]
    assert differ_deg(swings, expected) <= NEAR_DEG


def test_switches_states_and_steps(units: dict[str, Path], tmp_path: Path) -> None:
    with running(units["controller"], tmp_path) as slave:
        about = (slave.get("slew.state"), slave.get("slew.reason"))
        assert about == (State.NEUTRAL_WAIT, Reason.START)
        for tick in range(20):
            slave.step(tick)
        assert slave.get("slew.state") == State.READY
        slave.set("slew.demand", 1.0)
        slave.step(20, TICK_S / 2.0)  # the tick at its beginning
        assert slave.get("slew.state") == State.ACTIVE
        before = slave.get("slew.command")
        slave.step(20.5, TICK_S / 2.0)
        assert slave.get("slew.command") == before > 0.0
        slave.set("left.enable", 0.0)
        slave.step(21, 3.0)
        about = (slave.get("slew.state"), slave.get("slew.reason"), slave.get("slew.command"))
        assert about == (State.TRIPPED, Reason.ENABLE_LOST, 0.0)
        for name, value in (("left.enable", 1.0), ("slew.demand", 0.0), ("left.reset", 1.0)):
            assert slave.get("slew.state") == State.TRIPPED
            slave.set(name, value)
            slave.step(slave.get("time") / TICK_S, 1.0)
        assert slave.get("slew.state") == State.READY
        slave.set("left.anti_sway_off", 1.0)
        slave.set("slew.demand", 0.5)
        slave.step(slave.get("time") / TICK_S, 1.0)
        assert slave.get("slew.state") == State.BYPASS_ON
        slave.fmu.reset()
        assert (slave.get("time"), slave.get("slew.reason")) == (0.0, Reason.START)
        assert slave.said == []


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("slew.demand", math.nan, "expected a finite number"),
        ("slew.command", 1.0, "expected an input"),
    ],
)
def test_a_wrong_value_is_refused(
    units: dict[str, Path], tmp_path: Path, name: str, value: float, text: str
) -> None:
    with running(units["controller"], tmp_path) as slave:
        with pytest.raises(fmpy.fmi1.FMICallException):
            slave.set(name, value)
        assert slave.said == [text]


@pytest.mark.parametrize(
    ("tick", "length_s", "text"),
    [
        (1, 0.0, "communicationStepSize: expected more than 0 s"),
        (0, TICK_S, "currentCommunicationPoint: expected the end of the last step"),
        (2, TICK_S, "currentCommunicationPoint: expected the end of the last step"),
    ],
)
def test_a_step_that_does_not_follow_is_refused(
    units: dict[str, Path], tmp_path: Path, tick: int, length_s: float, text: str
) -> None:
    with running(units["plant"], tmp_path) as slave:
        slave.step(0)
        with pytest.raises(fmpy.fmi1.FMICallException):
            slave.step(tick, length_s)
        assert slave.said == [text]


@pytest.mark.parametrize("kind", ["controller", "plant"])
def test_its_sources_are_all(units: dict[str, Path], kind: str, tmp_path: Path) -> None:
    with zipfile.ZipFile(units[kind]) as archive:
        archive.extractall(tmp_path)
    shutil.rmtree(tmp_path / "binaries")
    if shutil.which("cmake") is None:
        pytest.skip("expected cmake, got none")
    from fmpy.build import build_platform_binary

    build_platform_binary(tmp_path)
    assert list((tmp_path / "binaries").rglob(f"canshaper_{kind}.*"))


def test_every_function_of_the_standard_is_there(units: dict[str, Path], tmp_path: Path) -> None:
    with zipfile.ZipFile(units["plant"]) as archive:
        archive.extractall(tmp_path)
    library = next((tmp_path / "binaries").rglob("*.so"))
    shown = subprocess.run(["nm", "-D", library], capture_output=True, text=True, check=True)
    text = (Path(fmpy.__file__).parent / "c-code/fmi3Functions.h").read_text(encoding="utf-8")
    asked = {line.split()[-1].rstrip(";") for line in text.splitlines() if "TYPE " in line}
    asked = {one for one in asked if one.startswith("fmi3")}
    assert len(asked) > 60
    there = {line.split()[-1] for line in shown.stdout.splitlines() if " T " in line}
    assert there == asked
