"""A package that adds a kind of filter: one file, and the kind is wherever the others are."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from hashlib import sha256
from pathlib import Path

import pytest

from tests.rigs.files import ROOT, machine_file

EXAMPLE = ROOT / "examples" / "own_filter"
SLEW = "filter: { kind: gff, a1: 0.708, a2: 0.12 }\n"
OWN = "filter: { kind: moving_average, window_s: %s }\n"
# What a drive, the comparison and a process of the comparison do with the kind.
WORK = """
import json, pickle, sys
from pathlib import Path
from canshaper.design.comparison.manoeuvres import candidates
from canshaper.design.comparison.manoeuvres import manoeuvres
from canshaper.design.comparison.measure import measure
from canshaper.design.comparison.summary import rows
from canshaper.design.lockstep import drive
from canshaper.machine.binding import load_deployment
from canshaper_sim.operator import script_named

deployment = load_deployment(Path(sys.argv[1]))
sent = drive(deployment, script_named("pulse-slew")).axes["slew"].sent
own = [c for c in candidates(deployment) if c.filters["slew"].kind == "moving_average"]
pulse = next(task for task in manoeuvres() if task.name == "pulse near-far")
outcomes = [measure(deployment, c, pulse, 0) for c in own]
print(json.dumps({
    "sent": sent,
    "rows": [(c.name, c.ours, c.motion) for c in own],
    "same": pickle.loads(pickle.dumps(own)) == own,
    "residual_deg": [o.residual_deg for o in outcomes],
}))
"""

# A filter with a mistake, and what the daemon's log says of it.
BROKEN = """
from canshaper import Parameter, ShaperKind


class Broken:
    def step(self, command):
        raise ZeroDivisionError("line 7")


WINDOW = Parameter("window_s", 0.1, 10, "s", "time")
KIND = ShaperKind(
    "moving_average", "Fails.", lambda tick_s, window_s: Broken(), lambda mode, s: {}, (WINDOW,),
    runs_ahead=False,
)
"""
EVENTS = """
import sys
from canshaper import Controller, load_machine

controller = Controller(load_machine(sys.argv[1]))
for tick in range(3):
    controller.tick(tick * 20_000_000)
print(*(event.text for event in controller.events()), sep="\\n")
"""


def installed(directory: Path, module: str = "") -> Path:
    """The package of the example as an installer leaves it; with another module on request."""
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]
    info = directory / f"crane_extras-{project['version']}.dist-info"
    info.mkdir(parents=True)
    heading = f"Name: {project['name']}\nVersion: {project['version']}\n"
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\n{heading}")
    points = project["entry-points"]["canshaper.shapers"]
    lines = ["[canshaper.shapers]", *(f"{name} = {value}" for name, value in points.items())]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
    shutil.copy(EXAMPLE / "moving_average.py", directory)
    if module:
        (directory / "moving_average.py").write_text(module)
    return directory


def python(packages: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command, environment = [sys.executable, *arguments], {**os.environ, "PYTHONPATH": str(packages)}
    return subprocess.run(
        command, env=environment, cwd=ROOT, capture_output=True, text=True, check=False
    )


def canshaper(packages: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return python(packages, "-m", "canshaper", *arguments)


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return installed(tmp_path_factory.mktemp("packages"))


def machine(directory: Path, window_s: str) -> tuple[Path, int]:
    """A machine whose slew axis has the filter, and the line that it stands in."""
    file = machine_file(directory, "forwarder", (SLEW, OWN % window_s))
    return file, file.read_text().partition("moving_average")[0].count("\n") + 1


@pytest.mark.slow
def test_it_is_in_the_schema_and_in_the_table(packages: Path) -> None:
    schema = json.loads(canshaper(packages, "config-schema").stdout)
    kinds = schema["$defs"]["AxisSection"]["properties"]["filter"]["discriminator"]["mapping"]
    assert kinds["moving_average"] == "#/$defs/MovingAverageFilter"
    window = schema["$defs"]["MovingAverageFilter"]["properties"]["window_s"]
    assert (window["minimum"], window["maximum"], window["unit"]) == (0.1, 10, "s")
    row = canshaper(packages, "config-schema", "--filters").stdout.splitlines()[-1]
    assert row == (
        "| `moving_average` | `window_s`: time over which the mean is taken, 0.1 to 10 s"
        " | Mean of the commands of the last seconds. |  |"
    )


@pytest.mark.slow
def test_check_knows_its_parameters(packages: Path, tmp_path: Path) -> None:
    file, line = machine(tmp_path, "2.4")
    done = canshaper(packages, "check", str(file))
    assert done.returncode == 0, done.stderr
    assert "-> moving_average -> " in done.stdout
    program = sha256((packages / "moving_average.py").read_bytes()).hexdigest()
    identity = f"filter=sha256:{program} kind=moving_average package=crane-extras 1.0"
    assert done.stdout.count(identity) == 1
    for window_s, got in (("11", "11"), ("x", "'x'")):
        says = f"expected 0.1 to 10 s, got {got}"
        machine(tmp_path, window_s)
        done = canshaper(packages, "check", str(file))
        assert done.returncode == 2
        assert done.stderr.startswith(f"{file}:{line}: axes.slew.filter.window_s: {says}")
        assert done.stderr.splitlines()[1:] in ([], ["1 problem"])


@pytest.mark.slow
def test_it_drives_an_axis_and_is_compared(packages: Path, tmp_path: Path) -> None:
    file, _ = machine(tmp_path, "2")
    done = python(packages, "-c", WORK, str(file))
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    # The mean over two seconds rises for two seconds, by half a percent of full each tick.
    sent = result["sent"]
    start = next(i for i, value in enumerate(sent) if value)
    steps = [sent[i + 1] - sent[i] for i in range(start, start + 90)]
    assert sum(steps) / len(steps) == pytest.approx(max(sent) / 100.0, rel=0.05)
    assert max(steps) <= 2.0 * max(sent) / 100.0
    assert result["rows"] == [["mean over a swing", False, False]]
    assert result["same"]
    assert len(result["residual_deg"]) == 1
    assert result["residual_deg"][0] < 2.0  # off leaves 16 degrees


@pytest.mark.slow
def test_an_error_of_it_is_named_with_its_text_and_place(tmp_path: Path) -> None:
    packages, (file, _) = installed(tmp_path / "packages", BROKEN), machine(tmp_path, "2")
    done = python(packages, "-c", EVENTS, str(file))
    assert done.returncode == 0, done.stderr
    place = f"{packages / 'moving_average.py'}:7"
    assert BROKEN.splitlines()[6].strip().startswith("raise ZeroDivisionError")
    assert done.stdout.splitlines() == [
        "axis=slew state=TRIPPED from=NEUTRAL_WAIT reason=OUTPUT_INVALID"
        f" error=ZeroDivisionError: line 7 ({place})"
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module", "says", "verb"),
    [
        (
            "import no_such_module\n",
            "ModuleNotFoundError: No module named 'no_such_module'",
            "run forwarder.yaml",
        ),
        (
            "KIND = 7\n",
            "ValueError: expected a ShaperKind, got a value of type int",
            "config-schema",
        ),
        (
            "from canshaper.shaping.registry import OFF as KIND\n",
            "ValueError: the kind 'off' is there already",
            "check forwarder.yaml",
        ),
    ],
)
def test_a_package_with_a_fault_is_named_in_one_line(
    tmp_path: Path, module: str, says: str, verb: str
) -> None:
    done = canshaper(installed(tmp_path / "packages", module), *verb.split())
    assert done.returncode == 2
    first, *rest = done.stderr.splitlines()
    name = "entry point moving_average of canshaper.shapers"
    assert first == f"package crane-extras: {name}: {says}"
    assert rest in ([], ["1 problem"])
    assert done.stdout == ""


def test_the_page_shows_the_table_as_it_is_printed() -> None:
    page = (ROOT / "docs" / "deployment.md").read_text(encoding="utf-8")
    table = canshaper(ROOT, "config-schema", "--filters").stdout
    assert f"<!-- generated: filters -->\n\n{table}\n<!-- end: filters -->" in page
    assert "(../examples/own_filter/moving_average.py)" in page
