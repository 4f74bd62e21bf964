"""The command line: exit codes, what it prints, and what it must not import or start."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import can
import pytest
import typer
from typer.testing import CliRunner

from canshaper import __version__
from canshaper.cli.app import app
from canshaper.cli.common import loader
from canshaper.errors import ConfigError
from canshaper.machine.binding import load_deployment

ROOT = Path(__file__).parents[2]
ROBUST = Path(__file__).parents[2] / "config" / "forwarder-robust.yaml"
SHIPPED = ROOT / "config" / "forwarder.yaml"
VERBS = sorted(typer.main.get_command(app).commands)  # type: ignore[attr-defined]

# Nothing of these belongs on a small machine PC.
HEAVY = ("casadi", "scipy", "numpy", "matplotlib", "pandas")


def invoke(*arguments: str) -> Any:
    return CliRunner().invoke(app, list(arguments), prog_name="canshaper")


@pytest.fixture
def broken(tmp_path: Path) -> Path:
    path = tmp_path / "broken.yaml"
    text = SHIPPED.read_text(encoding="utf-8").replace("../dbc", str(ROOT / "dbc"))
    path.write_text(text.replace("tick_ms: 20", "tick_ms: 0").replace("kind: off", "kind: x"))
    return path


@pytest.fixture
def two_buses(tmp_path: Path) -> Path:
    path = tmp_path / "two.yaml"
    text = SHIPPED.read_text(encoding="utf-8").replace("../dbc", str(ROOT / "dbc"))
    bus = "  crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }\n"
    path.write_text(text.replace(bus, bus + bus.replace("crane", "boom").replace("vcan0", "vcan1")))
    return path


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """Every attempt to open a bus; none succeeds."""
    attempts: list[dict[str, Any]] = []

    def refuse(**options: Any) -> None:
        attempts.append(options)
        raise OSError("no such device")

    monkeypatch.setattr(can, "Bus", refuse)
    return attempts


# -- check -----------------------------------------------------------------------------------------


def test_check_of_a_good_file_shows_what_it_does() -> None:
    result = invoke("check", str(SHIPPED))
    identity = load_deployment(SHIPPED).identity
    assert result.exit_code == 0
    assert result.stderr == ""
    before, _, _ = result.stdout.partition("\n  ".ljust(60))  # the table of stopping distances
    assert before.splitlines() == [
        f"{SHIPPED}: good",
        "  bus crane: socketcan vcan0, its 10 messages load 12% of 250 kbit/s",
        "  axis slew: JoystickLeft.Slew -> gff -> SlewCommand.Velocity every 20 ms",
        "  axis near_far: JoystickLeft.NearFar -> gff -> NearFarCommand.Velocity every 20 ms",
        "  axis lift: JoystickRight.Lift -> off -> LiftCommand.Velocity every 20 ms",
        "  slew is in no motion: together with another axis it leaves more swing;",
        "    a motion takes one axis that moves the tip in and out, which joints are not",
        f"  digest {identity.digest:#06x} of deployment, DBC files and program:",
        *(f"    {line}" for line in identity.lines()[1:]),
    ]


def test_check_shows_how_far_every_axis_travels_on() -> None:
    lines = invoke("check", str(SHIPPED)).stdout.splitlines()
    lines = lines[next(i for i, line in enumerate(lines) if "stops from" in line) :]
    assert max(map(len, lines)) <= 80
    rows = {line[:26].strip(): line[26:].split() for line in lines if line.startswith(" ")}
    # 0.5 rad/s at 9.6 m; lift has no speed
    assert rows["joystick released"] == ["3.63", "m", "22", "deg", "0.74", "m", "0.11", "s"]
    assert rows["joystick lost"] == ["4.11", "m", "25", "deg", "0.84", "m", "0.21", "s"]
    assert rows["limits allow"] == ["10.22", "m", "61", "deg", "2.13", "m", "0.63", "s"]
    assert rows["stop_distance_m"] == ["10.5", "m", "2.2", "m", "-"]
    assert "WARNING" not in "".join(lines)
    assert "lift: in seconds of full speed" in "".join(lines)
    assert "slewing: of one that slews" not in "".join(lines)


def test_check_says_which_axis_moves_without_its_joystick() -> None:
    note = (
        "  NOTE: while slew moves, near_far moves too without its joystick: by up to 0.25 m/s,"
        " 0.3 m in or out, 6 s"
    )
    assert note in invoke("check", "forwarder-robust.yaml").stdout.splitlines()
    assert "without its joystick" not in invoke("check", str(SHIPPED)).stdout


@pytest.mark.parametrize("name", ["forwarder-sensor", "j1939-sensor", "canopen-sensor"])
def test_check_counts_what_a_sway_sensor_moves_it_besides(tmp_path: Path, name: str) -> None:
    way = " m/s, 0.6 m in or out (0.3 for slewing, as much to damp by its sway sensor), 6 s"
    note = "near_far moves too without its joystick"
    shipped = ROOT / "config" / f"{name}.yaml"
    text = shipped.read_text(encoding="utf-8").replace("../dbc", str(ROOT / "dbc"))
    [row] = [row for row in invoke("check", str(shipped)).stdout.splitlines() if note in row]
    assert row.endswith(way)
    watched = tmp_path / "watched.yaml"
    watched.write_text(text.replace("use: damp", "use: watch"))
    [row] = [row for row in invoke("check", str(watched)).stdout.splitlines() if note in row]
    assert row.endswith(" m/s, 0.3 m in or out, 6 s")


def test_check_says_where_a_filter_no_longer_fits(
    tmp_path: Path,
) -> None:
    file = tmp_path / "machine.yaml"
    text = ROBUST.read_text(encoding="utf-8").replace("../dbc", str(ROOT / "dbc"))
    assert "designed" not in invoke("check", str(ROBUST)).stdout
    text = text.replace("sway: { period_s: 2.356", "sway: { period_s: 2.6")
    file.write_text(
        text.replace("mass_kg: 300", "mass_kg: 120").replace("fall_per_s: 5", "fall_per_s: 4")
    )
    result = invoke("check", str(file))
    assert result.exit_code == 0
    slew, near_far = (
        number for number, row in enumerate(text.splitlines(), 1) if "designed_for" in row
    )
    again = "; design it again: canshaper robust"
    slew_for, near_for = "axes.slew.filter.designed_for", "axes.near_far.filter.designed_for"
    valve = "valve_rate_per_s: expected a valve of 5 full speeds per s or more, got 4"
    assert [row for row in result.stdout.splitlines() if "designed_for" in row] == [
        f"WARNING: {file}:{slew}: {slew_for}.period_s:"
        f" expected a swing of 2.17 to 2.53 s, got 2.60 s{again}",
        f"WARNING: {file}:{slew}: {slew_for}.{valve}{again}",
        f"WARNING: {file}:{near_far}: {near_for}.damping_ratio:"
        f" expected a damping ratio of 0.019 to 0.079, got 0.121{again}",
        f"WARNING: {file}:{near_far}: {near_for}.{valve}{again}",
    ]


def unstated(tmp_path: Path) -> Path:
    """The shipped machine, whose slew does not state how far it may travel on."""
    text = SHIPPED.read_text(encoding="utf-8").replace("../dbc", str(ROOT / "dbc"))
    file = tmp_path / "unstated.yaml"
    file.write_text(text.replace(", stop_distance_m: 10.5", "").replace("    slewing:", "    #"))
    return file


LONG_WAY = (
    "axes.slew.limits.stop_distance_m: missing: to stop, the limits allow 3.2 m, which is more"
    " than 2 m; where that is meant, state stop_distance_m: 3.2"
)


def test_check_warns_of_a_long_way_that_is_not_stated(tmp_path: Path) -> None:
    file = unstated(tmp_path)
    result = invoke("check", str(file))
    assert result.exit_code == 0
    line = file.read_text().splitlines().index("  near_far:") - 1
    assert result.stdout.splitlines()[-1] == f"WARNING: {file}:{line}: {LONG_WAY}"
    assert "slewing: of one that slews" in " ".join(result.stdout.split())


def test_run_moves_nothing_over_a_long_way_that_is_not_stated(
    tmp_path: Path, opened: list[dict[str, Any]]
) -> None:
    file = unstated(tmp_path)
    result = invoke("run", str(file))
    assert result.exit_code == 2
    assert LONG_WAY in result.stderr
    assert opened == []
    assert invoke("run", str(file), "--listen-only").exit_code == 3  # as it moves nothing


def test_check_of_a_broken_file_reports_every_problem(broken: Path) -> None:
    result = invoke("check", str(broken))
    assert result.exit_code == 2
    assert result.stdout == ""
    line = (
        SHIPPED.read_text(encoding="utf-8")
        .splitlines()
        .index("tick_ms: 20 # period of the control loop")
    )
    first, second, count = result.stderr.splitlines()
    assert first == f"{broken}:{line + 1}: tick_ms: expected a whole number, 1 to 50 ms, got 0"
    assert (
        "axes.lift.filter.kind: expected one of 'off', 'gff', 'first_order', 's_curve', 'zv',"
        " 'zvd', 'ei', 'two_mode', 'robust', got 'x'" in second
    )
    assert count == "2 problems"


def test_check_of_no_file() -> None:
    result = invoke("check", "nowhere/none.yaml")
    assert result.exit_code == 2
    assert result.stderr.splitlines() == [
        "nowhere/none.yaml: No such file or directory",
        "1 problem",
    ]


@pytest.mark.parametrize(
    ("old", "new", "where", "got"),
    [
        ("dbc: [", 'dbc: ["a\\0b.dbc", ', "dbc.0", r"'a\x00b.dbc'"),
        (
            "tick_ms: 20",
            'tick_ms: 20\ncontrol: { socket: "/run/a\\0b",'
            " adjustable: { axes.slew.limits.max_pct: [20, 100] } }",
            "control.socket",
            r"'/run/a\x00b'",
        ),
    ],
)
def test_check_refuses_a_path_that_the_system_would_not_take(
    tmp_path: Path, old: str, new: str, where: str, got: str
) -> None:
    text = SHIPPED.read_text(encoding="utf-8").replace("../dbc", str(ROOT / "dbc"))
    file = tmp_path / "machine.yaml"
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    result = invoke("check", str(file))
    line = 1 + next(i for i, row in enumerate(file.read_text().splitlines()) if "\\0" in row)
    problem = f"{file}:{line}: {where}: expected text without control characters, got {got}"
    assert (result.exit_code, result.stderr.splitlines()) == (2, [problem, "1 problem"])


def test_a_shipped_file_goes_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("forwarder.yaml", "config/forwarder.yaml"):
        assert invoke("check", name).exit_code == 0
    assert invoke("check", "other/forwarder.yaml").exit_code == 2
    Path("forwarder.yaml").write_text("tick_ms: 0\n", encoding="utf-8")  # one that is there wins
    assert invoke("check", "forwarder.yaml").exit_code == 2


# -- run -------------------------------------------------------------------------------------------


def test_run_of_a_broken_file_opens_no_bus(broken: Path, opened: list[dict[str, Any]]) -> None:
    result = invoke("run", str(broken))
    assert result.exit_code == 2
    assert "tick_ms: expected a whole number, 1 to 50 ms, got 0" in result.stderr
    assert "kind: expected one of 'off', " in result.stderr
    assert ", got 'x'" in result.stderr
    assert opened == []


def test_run_without_its_bus_says_which(opened: list[dict[str, Any]]) -> None:
    result = invoke("run", str(SHIPPED), "--channel", "can7")
    assert result.exit_code == 3
    assert "bus crane: cannot open socketcan channel can7: " in result.stderr
    result = invoke("run", str(SHIPPED), "--interface", "virtual", "--channel", "can7")
    assert "bus crane: cannot open virtual channel can7: no such device" in result.stderr
    assert [(o["interface"], o["channel"]) for o in opened] == [("virtual", "can7")]


def test_bus_options(two_buses: Path) -> None:
    buses = loader(str(SHIPPED), "virtual", ["x"])().config.buses
    assert (buses["crane"].interface, buses["crane"].channel) == ("virtual", "x")
    buses = loader(str(two_buses), None, ["boom=can1", "crane=can0"])().config.buses
    assert {n: b.channel for n, b in buses.items()} == {"crane": "can0", "boom": "can1"}


def test_a_bus_is_shared_over_the_network_only_where_that_is_said(tmp_path: Path) -> None:
    """What a file says of sharing is not said of another interface."""
    text = SHIPPED.read_text(encoding="utf-8").replace("../dbc", str(ROOT / "dbc"))
    bus = "{ interface: socketcan, channel: vcan0, bitrate: 250000 }"
    shared = tmp_path / "machine.yaml"
    shared.write_text(
        text.replace(bus, "{ interface: udp_multicast, channel: 239.1.2.3, network: true }"),
        encoding="utf-8",
    )
    multicast = (str(shared), "udp_multicast")
    assert loader(str(shared))().config.buses["crane"].network
    assert loader(str(shared), None, ["239.1.2.4"])().config.buses["crane"].network
    assert not loader(*multicast)().config.buses["crane"].network
    assert loader(*multicast, network=True)().config.buses["crane"].network
    assert not loader(str(SHIPPED), "udp_multicast", ["239.1.2.3"])().config.buses["crane"].network
    says = "--network: expected udp_multicast only, got the interface socketcan"
    with pytest.raises(ConfigError, match=says):
        loader(str(SHIPPED), network=True)()


@pytest.mark.parametrize(
    ("channels", "says"),
    [
        (["x"], "expected NAME=CHANNEL with one of crane, boom, got 'x'"),
        (["jib=x"], "expected NAME=CHANNEL with one of crane, boom, got 'jib=x'"),
        (["crane=vcan1"], "expected a channel for each of crane, boom, got one for two of them"),
        (
            ["crane=a", "boom=a"],
            "expected a channel for each of crane, boom, got one for two of them",
        ),
    ],
)
def test_bus_options_that_do_not_fit(two_buses: Path, channels: list[str], says: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(f"command line: --channel: {says}")):
        loader(str(two_buses), None, channels)()


# -- the command itself ----------------------------------------------------------------------------


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("option", ["--help", "-h"])
def test_help_of_every_verb_has_an_example(verb: str, option: str) -> None:
    result = invoke(verb, option)
    assert result.exit_code == 0
    assert re.search(rf"Examples:\s+canshaper {verb}\b", result.stdout)


def test_help_names_every_verb() -> None:
    result = invoke("--help")
    assert result.exit_code == 0
    assert {"run", "check", "config-schema"} <= set(VERBS)
    assert all(re.search(rf"^\s+{verb}\s", result.stdout, re.MULTILINE) for verb in VERBS)


def test_version() -> None:
    result = invoke("--version")
    assert (result.exit_code, result.stdout) == (0, f"canshaper {__version__}\n")


@pytest.mark.parametrize("arguments", [["start"], ["check"], ["check", "--fast", "x"], ["run"]])
def test_wrong_use_is_an_error_without_a_traceback(arguments: list[str]) -> None:
    result = invoke(*arguments)
    assert result.exit_code == 2
    assert "Error: " in result.stderr
    assert isinstance(result.exception, SystemExit)


def python(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    return done.stdout.strip()


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
"""
    assert python(code) == "3 []"


def test_the_watch_of_heavy_imports_would_see_one() -> None:
    assert python("import sys, numpy; print('numpy' in sys.modules)") == "True"


@pytest.mark.parametrize(
    ("file", "slews"),
    [
        ("forwarder.yaml", ["slew"]),
        ("forwarder-joints.yaml", ["slew"]),
        ("two-cranes.yaml", ["front_slew", "rear_slew"]),
        ("forwarder-robust.yaml", []),
    ],
)
def test_check_names_an_axis_that_slews_in_no_motion(file: str, slews: list[str]) -> None:
    lines = invoke("check", file).stdout.splitlines()
    named = [line.split()[0] for line in lines if "is in no motion" in line]
    assert named == slews
    assert sum("which joints are not" in line for line in lines) == len(slews)


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


def test_the_module_is_the_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "canshaper", "check", str(SHIPPED)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0
    assert done.stdout.startswith(f"{SHIPPED}: good")


@pytest.mark.parametrize("ends", ["SystemExit(0)", "KeyboardInterrupt"])
def test_the_end_of_python_does_not_look_through_what_was_loaded(ends: str) -> None:
    """Its last collection of garbage took seconds after Ctrl-C, with CasADi and SciPy loaded."""
    code = f"""
import gc
from canshaper import __main__
from canshaper.cli import app
def end():
    raise {ends}
app.main = end
try:
    __main__.main()
except SystemExit as error:
    print(error.code, gc.get_freeze_count() > 1000)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout == f"{0 if '0' in ends else 130} True\n"
