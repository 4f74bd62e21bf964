"""A crane of someone else as an FMU: ``demo`` and ``campaign`` drive it; a misfit is named.

The crane of ``pendulum.c`` shares no code with ours. Driving needs fmpy: ``make test-exports``.
"""

import subprocess
import zipfile
from functools import partial
from math import hypot
from pathlib import Path
from typing import Any

import pytest

from canshaper.cli.app import main
from canshaper.design.lockstep import Simulation
from canshaper.errors import DesignError, DriveError
from canshaper_sim.operator import script_for
from canshaper_sim.strokes import Script
from tests.campaign.test_cli import rows
from tests.cli.invocation import invoke
from tests.native.judge import needs_compiler
from tests.rigs.files import CONFIG, read

ROBUST = read(CONFIG / "forwarder-robust.yaml")
NUMBERS = (
    *("Slew_Command", "nearFar.Command", "LIFT[command]"),
    *("Slew_Angle", "near_far.radius", "lift.height"),
    *("Slew_Speed", "near_far.speed", "lift.speed"),
    *("sway.across", "sway.along", "sway.across_rate", "sway.along_rate"),
)
MODEL = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="pendulum" guid="other">
<{kind} modelIdentifier="pendulum"/>
<DefaultExperiment stepSize="{step_s}"/>
<ModelVariables>{variables}</ModelVariables><ModelStructure><Outputs>{outputs}</Outputs></ModelStructure>
</fmiModelDescription>"""


def unit(
    folder: Path,
    *,
    absent: str = "",
    kind: str = "CoSimulation",
    step_s: float = 0.02,
    fails_at: float = 1e9,
) -> Path:
    """An FMU of the other crane."""
    needs_compiler()
    library, path = folder / "pendulum.so", folder / "pendulum.fmu"
    source = Path(__file__).with_name("pendulum.c")
    flags = ["-std=c99", "-O2", "-shared", "-fPIC", f"-DFAILS_AT={fails_at}"]
    subprocess.run(["cc", *flags, "-o", library, source, "-lm"], check=True)
    variables = outputs = ""
    for at, name in enumerate(NUMBERS):
        if name == absent:
            continue
        of = 'causality="input"' if at < 3 else 'causality="output"'
        start = '<Real start="0"/>' if at < 3 else "<Real/>"
        text = f'<ScalarVariable name="{name}" valueReference="{at}" {of}>{start}'
        variables += f"{text}</ScalarVariable>"
        outputs += f'<Unknown index="{variables.count("</S")}"/>' if at >= 3 else ""
    text = MODEL.format(kind=kind, variables=variables, outputs=outputs, step_s=step_s)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        archive.write(library, "binaries/linux64/pendulum.so")
    return path


called = partial(invoke, columns=120)


@pytest.fixture
def fmpy() -> None:
    pytest.importorskip("fmpy", reason="fmpy is not installed: make test-exports")


foreign = pytest.mark.filterwarnings("default")


@foreign
@pytest.mark.slow
@pytest.mark.usefixtures("fmpy")
def test_another_crane_swings_by_itself_and_the_controller_calms_it(tmp_path: Path) -> None:
    """Its own period shows, and its radius goes into the motion."""
    path, script = unit(tmp_path), script_for(ROBUST, "demo")
    left_rad, own = {}, {}
    for bypass in (True, False):
        of: list[Any] = []
        for plant in (path, None):
            options: Any = {"unit": plant} if plant else {}
            simulation = Simulation(ROBUST, script, bypass=bypass, **options)
            of.append([simulation.plant.crane.state for _ in simulation.ticks()])
        own[bypass] = max(abs(a.theta6_rad - b.theta6_rad) for a, b in zip(*of, strict=True))
        left_rad[bypass] = max(hypot(*one[7:9]) for one in of[0][-150:])
        assert of[0][-1].radius_m == pytest.approx(of[1][-1].radius_m, abs=0.3)
    assert own[True] > 0.02  # it is not ours
    assert left_rad[False] < 0.2 * left_rad[True]


@foreign
@pytest.mark.slow
@pytest.mark.usefixtures("fmpy")
def test_demo_and_campaign(tmp_path: Path) -> None:
    path = unit(tmp_path)
    done = called("demo", "--plant", path, "--out", tmp_path / "demo")
    assert done.exit_code == 0 and "lock-step, no bus" in done.output, done.output
    done = called("demo", "--plant", path, "--seed", 3, "--out", tmp_path / "demo")
    assert done.exit_code == 0, done.output
    out = tmp_path / "campaign"
    options = ("-n", 4, "--plant", path, "--out", out)
    done = called("campaign", *options)
    assert done.exit_code == 0, done.output
    assert f"engine: python, in one process: the crane is {path}" in done.output
    kept = rows(out)
    assert [row["engine"] for row in kept] == ["python"] * 4
    assert "length_pct" not in kept[0]  # drawn of a crane that does not drive
    assert all(0.0 < row["residual_deg"] < row["peak_deg"] for row in kept)
    path.write_bytes(path.read_bytes() + b" ")
    assert called("campaign", *options, "--resume").exit_code == 2  # it is another crane


@foreign
@pytest.mark.usefixtures("fmpy")
@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"absent": "Slew_Command"}, r"expected numbers slew\.command \(input\), got none"),
        ({"absent": "sway.along"}, r"expected numbers sway\.along \(output\), got none"),
        ({"step_s": 0.05}, r"expected a step of 0\.02 s, as tick_ms, or a whole part, got 0\.05"),
        ({"kind": "ModelExchange"}, "expected FMI 2.0 or 3.0 for co-simulation"),
    ],
)
def test_a_unit_that_does_not_fit_is_refused_by_name(
    given: dict[str, Any], text: str, tmp_path: Path
) -> None:
    with pytest.raises(DesignError, match=text):
        Simulation(ROBUST, Script("still", (), 1.0), unit=unit(tmp_path, **given))


@foreign
@pytest.mark.usefixtures("fmpy")
def test_other_faults_of_a_unit(tmp_path: Path) -> None:
    still = Script("still", (), 1.0)
    with pytest.raises(DesignError, match=r"expected axes that move the tip, got bridge, hoist"):
        Simulation(read(CONFIG / "bridge-crane.yaml"), still, unit=unit(tmp_path))
    (tmp_path / "failing").mkdir()
    simulation = Simulation(ROBUST, still, unit=unit(tmp_path / "failing", fails_at=0.5))
    with pytest.raises(DriveError, match=r"pendulum\.fmu: at 0\.5\d s: "):
        for _ in simulation.ticks():
            pass
    no_unit = tmp_path / "text.fmu"
    no_unit.write_text("text")
    with pytest.raises(DesignError, match=r"text\.fmu: expected an FMU: "):
        Simulation(ROBUST, still, unit=no_unit)


@pytest.mark.parametrize(
    "options", [("--processes", "2"), ("--engine", "native"), ("--scheduler", "tcp://10.0.0.1:1")]
)
def test_a_campaign_of_a_unit_has_one_process(options: tuple[str, ...], tmp_path: Path) -> None:
    done = called("campaign", "--plant", "crane.fmu", "--out", tmp_path, *options)
    assert done.exit_code == 2 and "--plant: expected one process of Python" in done.output


def test_without_fmpy_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "fmpy", None)
    monkeypatch.setattr("sys.argv", ["canshaper", "demo", "--plant", "crane.fmu"])
    with pytest.raises(SystemExit):
        main()
    assert "this command needs fmpy, which is missing: " in capsys.readouterr().err
