"""The lane as its users see it: a few real runs from the host, and what needs no run."""

import os
import platform
import select
import signal
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from . import cli, hil, job, kernel, native
from .outcome import LANE_FAILED, NO_LANE, TIME_LIMIT

ROOT = Path(__file__).resolve().parents[2]
ENDED_S = 60.0  # only to end a test that hangs
# A shell's trap would lose a signal that comes just before the shell waits for a command.
INTERRUPTED = """
from signal import *
pthread_sigmask(SIG_BLOCK, [SIGINT])
print("ready", flush=True)
sigwait([SIGINT])
print("interrupted", flush=True)
pause()
"""


@pytest.fixture(scope="module")
def lane() -> str:
    """Return the lane that this machine gets; skip where there is none."""
    if "CANSHAPER_LANE" in os.environ:
        pytest.skip("already in a lane")
    done = subprocess.run(
        [sys.executable, "-m", "tests.lane", "--prepare"],
        cwd=ROOT,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    if done.returncode == NO_LANE:
        pytest.skip(done.stderr)
    assert done.returncode == 0, done.stderr
    return "native" if native.obstacle() is None else "tcg"


def words(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "tests.lane", *arguments]


def run(*arguments: str, env: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        words(*arguments),
        cwd=ROOT,
        env={**os.environ, **(env or {})},
        capture_output=True,
        text=True,
        check=False,
    )


def test_status_output_environment_and_files(lane: str, tmp_path: Path) -> None:
    kept, lost = tmp_path / "kept", tmp_path / "lost"
    kept.mkdir()
    lost.mkdir()
    script = f"""
        echo "$CANSHAPER_LANE|$WORD|$PWD"
        echo to stderr >&2
        echo 1 >{kept}/file
        echo 1 >{lost}/file
        exit 7
    """
    word = 'it\'s "one" $word\n'
    done = run("--rw", str(kept), "--", "sh", "-c", script, env={"WORD": word})
    assert done.returncode == 7, done.stderr
    assert done.stdout == f"{lane}|{word}|{ROOT}\n"
    assert done.stderr == "to stderr\n"
    assert (kept / "file").read_text() == "1\n"
    assert (lost / "file").exists() == (lane == "native")


def test_time_limit(lane: str) -> None:
    done = run("--timeout", "1", "--", "sleep", "1000")
    assert done.returncode == TIME_LIMIT
    assert "time limit of 1 s" in done.stderr


def test_failing_boot_is_not_the_commands_failure(lane: str) -> None:
    if lane != "tcg":
        pytest.skip("the native lane boots no kernel")
    # no init: the kernel panics
    done = run("--lane", "tcg", "--append", "rdinit=/none", "--", "true")
    assert done.returncode == LANE_FAILED
    assert "ended without a status" in done.stderr
    assert "Kernel panic" in done.stderr


def test_signal_reaches_the_command_and_kill_leaves_nothing(lane: str) -> None:
    with subprocess.Popen(
        words("--", sys.executable, "-c", INTERRUPTED), cwd=ROOT, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGINT)
        assert process.stdout.readline() == "interrupted\n"
        # the machine, or the command, and the guard that ends it
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text()
        descriptors = [os.pidfd_open(int(pid)) for pid in children.split()]
        assert len(descriptors) == 2
        process.kill()
        for descriptor in descriptors:
            assert select.select([descriptor], [], [], ENDED_S)[0], "a child outlives the lane"
            os.close(descriptor)


def no_lane(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "obstacle", lambda: "no vcan")
    monkeypatch.setattr(platform, "machine", lambda: "riscv64")


def test_no_lane_has_a_status_and_reasons(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    no_lane(monkeypatch)
    assert cli.main(["--", "true"]) == NO_LANE
    error = capsys.readouterr().err
    assert "no vcan" in error
    assert "riscv64" in error


def test_hil_without_a_lane_is_not_a_failure(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    no_lane(monkeypatch)
    monkeypatch.chdir(ROOT)
    assert hil.main([]) == 0
    assert "NOT run" in capsys.readouterr().err


def test_host_only_variables_stay_outside() -> None:
    host = {"PATH": "/a:/sbin", "NOTIFY_SOCKET": "x", "BASH_FUNC_f%%": "() {", "HOME": "/h"}
    env = job.environment(host, "tcg", ("can0", "can1"))
    assert env == {
        "PATH": "/a:/sbin:/usr/sbin",
        "HOME": "/h",
        "CANSHAPER_LANE": "tcg",
        "CANSHAPER_VCAN": "vcan0 vcan1",
        "CANSHAPER_CAN": "can0 can1",
    }


def test_modules_are_loaded_after_what_they_need(tmp_path: Path) -> None:
    dependencies = "k/vcan.ko.xz: k/can-dev.ko.xz k/can.ko.xz\nk/can-dev.ko.xz: k/can.ko.xz\n"
    (tmp_path / "modules.dep").write_text(dependencies + "k/can.ko.xz:\n")
    (tmp_path / "modules.builtin").write_text("k/virtio_pci.ko\n")
    order = kernel.module_order(tmp_path, ["virtio_pci", "can", "vcan"])
    assert [path.name for path in order] == ["can.ko.xz", "can-dev.ko.xz", "vcan.ko.xz"]


def test_module_signature_is_removed(tmp_path: Path) -> None:
    signature = b"s" * 20
    info = bytes(8) + struct.pack(">I", len(signature))
    (tmp_path / "a.ko").write_bytes(b"\x7fELF" + signature + info + kernel.SIGNATURE)
    assert kernel.read_module(tmp_path / "a.ko") == b"\x7fELF"
