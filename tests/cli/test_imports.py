"""Modules that the command line imports, and its verbs without the desk tools."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.invocation import SHIPPED
from tests.rigs.files import ROOT

# The recommended file loads so many of our modules and lines at most, the gate's 2 300 included.
# It sends its aim point, for which it follows the run-on of its filters.
MOST_MODULES, MOST_LINES = 111, 20_300
# Nothing of these belongs on a small machine PC.
HEAVY = ("casadi", "scipy", "numpy", "matplotlib", "pandas")


def python(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    return done.stdout.strip()


@pytest.mark.slow
def test_the_daemon_loads_what_its_file_needs() -> None:
    code = f"""
import sys
from pathlib import Path
import canshaper.daemon.daemon
from canshaper.controller.controller import Controller
from canshaper.machine.binding import load_deployment
Controller(load_deployment(Path({str(ROOT / "config/forwarder-robust.yaml")!r})))
files = [m.__file__ for n, m in sys.modules.items() if n.partition(".")[0] == "canshaper"]
print(len(files), sum(Path(file).read_text(encoding="utf-8").count("\\n") for file in files))
"""
    modules, lines = map(int, python(code).split())
    assert modules <= MOST_MODULES, "import where the file has it, see protocols/registry.py"
    assert lines <= MOST_LINES


@pytest.mark.slow
def test_the_daemon_imports_nothing_heavy() -> None:
    code = f"""
import sys
from pathlib import Path
import canshaper.cli.app, canshaper.bus.port, canshaper.daemon.daemon
from canshaper.cli.common import loader
from canshaper.controller.controller import Controller
controller = Controller(loader({str(SHIPPED)!r})())
for i in range(100):
    list(controller.tick(i * 20_000_000))
print(len(controller.axes), sorted({{m.split(".")[0] for m in sys.modules}} & set({HEAVY!r})))
print([m for m in sys.modules if m.startswith("canshaper.protocols.") and m.count(".") > 2])
"""
    assert python(code) == "3 []\n[]"  # no protocol that the file does not speak


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["forwarder-robust", "canfd-forwarder", "gateway-forwarder", "forwarder-sensor"]
)
def test_what_a_tick_may_need_is_loaded_before_the_first_one(name: str) -> None:
    """In motion, with a fault, a trip, missed ticks, a standstill and a reload that has to wait."""
    code = f"""
import sys
from pathlib import Path
import canshaper.daemon.daemon
from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.daemon.reloads import Reloads
from canshaper.machine.binding import load_deployment
from canshaper_sim.hand import Hand, Held
deployment = load_deployment(Path({str(ROOT / "config")!r}) / "{name}.yaml")
controller, hand = Controller(deployment), Hand(deployment)
gated, reloads = GatedController(controller), Reloads(lambda: deployment, print)
before, moved, sent = {{*sys.modules}}, False, []
for i in range(200):
    now_ns = i * deployment.config.tick_ms * 1_000_000
    pushed = 0.0 if i < 30 else 1.0 if i < 60 else -1.0
    held = Held(dict.fromkeys(deployment.axes, pushed), enable=i < 190)
    frames = hand.frames(i * deployment.config.tick_ms, held)
    if i > 100:
        frames = [Frame(*frame[:3], frame.data[:-1]) for frame in frames]
    for frame in (*frames, *(sent if i == 95 else ())):
        gated.receive(frame, now_ns)
    if i == 90:
        gated.stalled()
    sent = [*gated.tick(now_ns, 3 if i == 80 else 0)]
    moved |= not controller.neutral
    if not controller.neutral:
        reloads.request()
        reloads.step(neutral=False)
    [event.text for event in controller.events]
gated.neutral_frames()
print(moved, sorted({{*sys.modules}} - before))
"""
    assert python(code) == "True []"


def test_the_watch_of_heavy_imports_would_see_one() -> None:
    assert python("import sys, numpy; print('numpy' in sys.modules)") == "True"


# The imports stand for a machine without the extra.
WITHOUT_TOOLS = """
import sys
sys.modules.update(dict.fromkeys({gone!r}))
sys.argv = ["canshaper", *{arguments!r}]
from canshaper.cli.app import main
main()
"""


def without(gone: tuple[str, ...], folder: Path, *arguments: str) -> "subprocess.CompletedProcess":
    code = WITHOUT_TOOLS.format(gone=gone, arguments=arguments)
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=folder
    )


# Into the environment that runs, from wherever a reader stands.
TOOLS = f"{sys.executable} -m pip install canopen casadi matplotlib numpy scipy"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("missing", "arguments"),
    [
        ("numpy", ("tune", str(SHIPPED), "--axis", "slew")),
        ("casadi", ("tune", str(SHIPPED), "--axis", "slew")),
        ("numpy", ("robust", str(SHIPPED), "--axis", "slew")),
        ("scipy", ("robust", str(SHIPPED), "--axis", "slew")),
        ("numpy", ("compare",)),
    ],
)
def test_without_the_tools_a_verb_says_what_to_install(
    missing: str, arguments: tuple[str, ...], tmp_path: Path
) -> None:
    done = without((missing,), tmp_path, *arguments)
    text = f"this command needs {missing}, which is missing: {TOOLS}\n"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", text)


@pytest.mark.slow
def test_without_the_tools_there_is_a_demo_but_no_picture(tmp_path: Path) -> None:
    arguments = ("demo", "--lockstep", "--script", "pulse-near_far")
    done = without(("casadi", "matplotlib", "numpy", "scipy"), tmp_path, *arguments)
    assert (done.returncode, done.stderr) == (0, "")
    assert f"Picture: none, matplotlib is missing: {TOOLS}" in done.stdout
    assert [path.name for path in tmp_path.rglob("*.*")] == ["report.json"]


def test_a_module_that_is_no_tool_is_a_fault_of_ours(tmp_path: Path) -> None:
    done = without(("yaml",), tmp_path, "check", str(SHIPPED))
    assert done.returncode == 1
    assert "ModuleNotFoundError: import of yaml halted" in done.stderr


def test_help_needs_no_library_of_the_network() -> None:
    """It imports every verb for its line; these take longer than the rest of it."""
    code = "import sys; sys.argv[1:] = ['--help']; from canshaper.cli.app import main\n"
    code += (
        "try: main()\nfinally: print({'ssl', 'email', 'http'} & {*sys.modules}, file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stderr == "set()\n"
