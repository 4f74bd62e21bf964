"""Desk work on other systems than Linux, which we do not have: without the names that only it has.

What cannot be shown so is how paths, terminals and processes behave there.
"""

import subprocess
import sys
from pathlib import Path

import pytest

from canshaper.cli.app import LINUX_ONLY
from canshaper.machine.binding import load_deployment

ROOT = Path(__file__).parents[2]
# Names of Windows' Python are fewer than those of macOS; numpy and matplotlib look at some of
# Linux' by themselves, because this still is Linux: os.uname stays.
ELSEWHERE = """
import matplotlib, numpy, os, platform, signal, socket, sys, sysconfig, time
sysconfig.get_config_vars()
platform.system, sys.platform = lambda: "Darwin", "darwin"

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


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("check config/forwarder-robust.yaml", "slew"),
        ("demo --script pulse-near_far", "Picture:"),
        ("replay tests/golden/drive.log --config forwarder-robust.yaml", "replay.png"),
        ("tune config/forwarder.yaml --axis near_far", "Picture:"),
        ("robust config/forwarder.yaml --axis near_far", "taps"),
        ("identify --swings 10 --seconds 23.6 --first 20 --last 5", "period_s: 2.3539"),
    ],
)
def test_desk_work_runs_on_any_system(line: str, answer: str, tmp_path: Path) -> None:
    out = () if line.startswith(("check", "robust")) else ("--out", tmp_path)
    done = called(*line.split(), *out)
    assert done.returncode == 0, done.stderr
    assert answer in done.stdout


def test_what_is_found_is_written_on_any_system(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    text = (ROOT / "config" / "forwarder.yaml").read_text(encoding="utf-8")
    file.write_text(text.replace("../dbc", str(ROOT / "dbc")), encoding="utf-8")
    done = called("robust", file, "--axis", "near_far", "--write")
    assert done.returncode == 0, done.stderr
    assert load_deployment(file).axes["near_far"].config.filter.kind == "robust"


@pytest.mark.parametrize("verb", sorted(LINUX_ONLY))
def test_what_needs_linux_says_so(verb: str) -> None:
    file = () if verb == "studio" else ("config/forwarder.yaml",)
    done = called(verb, *file)
    assert (done.returncode, done.stderr) == (
        2,
        f"canshaper {verb}: expected Linux, got darwin\n",
    )
    assert called(verb, "--help").returncode == 0
