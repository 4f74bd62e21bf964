"""Desk work on other systems than Linux, which we do not have: without the names that only it has.

What cannot be shown so is how paths, terminals and processes behave there.
"""

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from websockets.sync.client import connect

from canshaper.cli.app import LINUX_ONLY
from canshaper.machine.binding import load_deployment
from tests.commissioning.nodes.eds_files import JOYSTICK, VALVE, write
from tests.rigs.files import ROOT, machine_file
from tests.studio.page import Page

# Names of Windows' Python are fewer than those of macOS; numpy and matplotlib look at some of
# Linux' by themselves, because this still is Linux: os.uname stays.
ELSEWHERE = """
import matplotlib, numpy, os, platform, signal, socket, sys, sysconfig, time
sysconfig.get_config_vars()
platform.system, sys.platform = lambda: "Darwin", "darwin"

# asyncio wakes itself by a pair of sockets, which Linux makes of no other family.
unix, pair = socket.AF_UNIX, socket.socketpair
socket.socketpair = lambda: pair(unix)

def without(module, *starts):
    for name in [n for n in vars(module) if n.startswith(starts)]:
        delattr(module, name)

without(socket, "AF_CAN", "AF_NETLINK", "AF_UNIX", "CAN", "CMSG", "MSG_DONTWAIT", "PF_CAN", "SCM_")
without(socket, "SOCK_CLOEXEC", "SOCK_NONBLOCK", "SOL_CAN", "SO_PEERCRED", "SO_REUSEPORT")
without(signal, "SIGALRM", "SIGCHLD", "SIGCONT", "SIGHUP", "SIGKILL", "SIGPIPE", "SIGQUIT")
without(signal, "SIGSTOP", "SIGTSTP", "SIGUSR", "SIGWINCH", "pthread_", "sigtimedwait", "sigwait")
without(os, "eventfd", "fchmod", "fchown", "getloadavg", "geteuid", "getgid", "getuid", "memfd")
without(os, "mkfifo", "pidfd", "sched_")
without(time, "CLOCK_", "clock_")
for module in ("fcntl", "grp", "pty", "pwd", "resource", "syslog", "termios", "tty"):
    sys.modules[module] = None
from canshaper.cli.app import main
main()
"""


def called(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", ELSEWHERE, *map(str, words)]
    return subprocess.run(command, cwd=ROOT, text=True, capture_output=True, check=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("check config/forwarder-robust.yaml", "slew"),
        ("demo --script pulse-near_far", "Picture:"),
        ("replay tests/golden/drive.log --config forwarder-robust.yaml", "replay.png"),
        ("tune config/forwarder.yaml --axis near_far", "Picture:"),
        ("robust config/forwarder.yaml --axis near_far", "taps"),
        ("calibrate config/forwarder.yaml --axis slew", "curve_speed_pct"),
        ("identify --swings 10 --seconds 23.6 --first 20 --last 5", "period_s: 2.3539"),
    ],
)
def test_desk_work_runs_on_any_system(line: str, answer: str, tmp_path: Path) -> None:
    out = () if line.startswith(("check", "robust", "calibrate")) else ("--out", tmp_path)
    done = called(*line.split(), *out)
    assert done.returncode == 0, done.stderr
    assert answer in done.stdout


@pytest.mark.slow
def test_what_is_found_is_written_on_any_system(tmp_path: Path) -> None:
    file = machine_file(tmp_path, "forwarder")
    done = called("robust", file, "--axis", "near_far", "--write")
    assert done.returncode == 0, done.stderr
    assert load_deployment(file).axes["near_far"].config.filter.kind == "robust"


@pytest.mark.slow
@pytest.mark.parametrize("verb", sorted(LINUX_ONLY))
def test_what_needs_linux_says_so(verb: str) -> None:
    done = called(verb, "config/forwarder.yaml")
    assert (done.returncode, done.stderr) == (2, f"canshaper {verb}: expected Linux, got darwin\n")
    assert called(verb, "--help").returncode == 0


@pytest.mark.slow
@pytest.mark.parametrize("options", ["--shadow", "--channel vcan0", "--interface socketcan"])
def test_a_studio_with_a_bus_needs_linux(options: str) -> None:
    done = called("studio", "forwarder.yaml", *options.split())
    assert (done.returncode, done.stderr) == (2, "studio with a bus: expected Linux, got darwin\n")


@contextmanager
def studio(file: str) -> Iterator[Page]:
    """A page of a studio without Linux' names."""
    command = [sys.executable, "-c", ELSEWHERE, "studio", file, "--port", "0"]
    process = subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    assert process.stdout
    try:
        line = process.stdout.readline()
        match = re.search(r"open http://([0-9.:]+)/ in", line)
        assert match, line + process.stdout.read()
        with connect(f"ws://{match[1]}/ws", origin=f"http://{match[1]}") as page:
            yield Page(page)
        process.terminate()
        rest, _ = process.communicate(timeout=30)
        assert (process.returncode, rest) == (0, "")
    finally:
        process.kill()
        process.wait()


@pytest.mark.slow
@pytest.mark.parametrize("file", ["forwarder-robust.yaml", "j1939-forwarder.yaml"])
def test_the_studio_drives_its_simulated_cranes_on_any_system(file: str) -> None:
    """Both cranes move and stop, the shaped one swings less, and a slider changes a filter."""
    with studio(file) as page:
        swings = page.stroke(0.5, 0.5)
        assert swings["raw"] > 5.0
        assert swings["shaped"] < swings["raw"] / 3
        name = next(iter(page.hello["sliders"]))
        page.send(slide=name, to=1.1)
        page.until(lambda s: s["sliders"][name] == 1.1, "the slider")
        assert not page.refused


@pytest.mark.slow
def test_a_first_deployment_of_eds_files_is_written_on_any_system(tmp_path: Path) -> None:
    for name, objects in (("joystick", JOYSTICK), ("valve", VALVE)):
        write(tmp_path / f"{name}.eds", objects)
    answers = tmp_path / "answers.txt"
    answers.write_text(
        "joystick_TPDO1: enable switch = Buttons_1\n"
        "Axis of joystick_TPDO1.Slew = slew\nslew: valve command = valve_RPDO1.SetPoint"
    )
    file = tmp_path / "machine.yaml"
    eds = [word for name in ("joystick", "valve") for word in ("--eds", tmp_path / f"{name}.eds")]
    done = called("init", file, *eds, "--answers", answers)
    assert done.returncode == 0, done.stderr
    assert load_deployment(file).axes["slew"].config.filter.kind == "robust"


@pytest.mark.slow
def test_a_bus_of_linux_is_an_error_of_one_line() -> None:
    done = called("sim", "config/forwarder.yaml")
    text = "bus crane: cannot open socketcan channel vcan0: it needs Linux, got darwin"
    assert (done.returncode, done.stderr) == (3, f"{text}; python-can has other interfaces\n")
