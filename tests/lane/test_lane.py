"""The lane as its users see it: a few real runs from the host, and what needs no run."""

import os
import platform
import select
import signal
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from . import cli, hil, job, kernel, machine, native, packages, services
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


# The command below systemd: what it finds, then one status of a unit that is not its own.
BOOTED = """
systemctl is-system-running
systemctl is-active sys-subsystem-net-devices-can0.device
systemd-detect-virt
echo "$CANSHAPER_SYSTEMD|$JOURNAL_STREAM|$INVOCATION_ID"
grep SigIgn /proc/self/status
echo to stderr >&2
systemd-run --quiet --pipe --wait -p DynamicUser=yes -p StateDirectory=lane sh -c '
    id -u >$STATE_DIRECTORY/uid || exit 1
    echo "wrote $(($(cat $STATE_DIRECTORY/uid) > 60000))"
    exit 5
'
"""


def prepared(*options: str) -> None:
    """Get the lane with these options ready; skip where it cannot be had."""
    if "CANSHAPER_LANE" in os.environ:
        pytest.skip("already in a lane")
    done = run("--prepare", *options)
    if done.returncode == NO_LANE:
        pytest.skip(done.stderr)
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def lane() -> str:
    """Return the lane that this machine gets; skip where there is none."""
    prepared()
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_time_limit(lane: str) -> None:
    done = run("--timeout", "1", "--", "sleep", "1000")
    assert done.returncode == TIME_LIMIT
    assert "time limit of 1 s" in done.stderr


@pytest.mark.slow
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


@pytest.mark.slow
def test_systemd_has_booted_and_runs_the_command() -> None:
    prepared("--systemd")
    done = run("--systemd", "--", "sh", "-c", BOOTED)
    assert done.returncode == 5, done.stderr
    assert done.stderr == "to stderr\n"
    running, device, virtual, env, ignored, unit = done.stdout.splitlines()
    assert (running, device, virtual) == ("running", "active", "qemu")
    assert env == "1||"
    assert int(ignored.split()[1], 16) & 1 << signal.SIGPIPE - 1 == 0
    assert unit == "wrote 1"


@pytest.mark.slow
def test_bench_counts_instructions_instead_of_time() -> None:
    prepared("--bench")
    script = "sleep 3600; date -u +%F; echo $PYTHONHASHSEED"
    done = run("--bench", "--timeout", "300", "--", "sh", "-c", script)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "2026-01-01\n0\n"


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


@pytest.mark.parametrize("main", [hil.main, services.main])
def test_suite_without_a_lane_says_why(
    main: Callable[[list[str]], int],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    no_lane(monkeypatch)
    monkeypatch.chdir(ROOT)
    assert main([]) == NO_LANE
    assert "riscv64" in capsys.readouterr().err


SPECIAL = [["--systemd"], ["--bench"], ["--kernel", "rt"], ["--append", "quiet"]]


@pytest.mark.parametrize("options", SPECIAL)
def test_special_machine_is_never_the_native_lane(
    options: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(native, "obstacle", lambda: None)
    monkeypatch.setattr(machine, "obstacle", lambda _flavour, _systemd: None)
    assert cli.main(["--detect"]) == 0
    assert capsys.readouterr().out.endswith("lane: native\n")
    assert cli.main(["--detect", *options]) == 0
    assert capsys.readouterr().out.endswith("lane: tcg\n")
    with pytest.raises(SystemExit):
        cli.main(["--lane", "native", *options, "--", "true"])
    assert "boots no kernel" in capsys.readouterr().err


def test_absent_udev_is_named_only_where_it_is_needed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def which(program: str) -> str | None:
        return None if program == "udevadm" else "/dev/null"

    monkeypatch.setattr(packages, "which", which)
    monkeypatch.setattr(machine, "which", which)
    monkeypatch.setattr(machine, "cannot_install", lambda: "only root can install them")
    monkeypatch.setattr(platform, "machine", lambda: "x86_64")
    assert cli.main(["--systemd", "--", "true"]) == NO_LANE
    assert "please install udev (only root" in capsys.readouterr().err
    assert "udev" not in (machine.obstacle("std", False) or "")


def test_kernels_of_both_flavours_lie_side_by_side(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for version in ("6.1.0-9-amd64", "6.1.0-50-amd64", "6.1.0-56-rt-amd64"):
        folder = packages.cache() / "kernels" / version
        (folder / "lib/modules" / version).mkdir(parents=True)
        (folder / "vmlinux").touch()
    images = {flavour: kernel.cached(flavour) for flavour in kernel.META_PACKAGES}
    versions = {flavour: image.version for flavour, image in images.items() if image}
    assert versions == {"std": "6.1.0-50-amd64", "rt": "6.1.0-56-rt-amd64"}


def test_rt_is_another_package(monkeypatch: pytest.MonkeyPatch) -> None:
    depends = {
        "linux-image-amd64": "  Depends: linux-image-6.1.0-50-amd64\n",
        "linux-image-rt-amd64": "  Depends: linux-image-6.1.0-50-rt-amd64\n",
    }
    downloaded = []

    def output(program: str, *words: str, cwd: Path | None = None) -> str:
        if program == "apt-get":
            downloaded.append(words[-1])
        return depends.get(words[-1], "")

    monkeypatch.setattr(kernel, "output", output)
    for metas in kernel.META_PACKAGES.values():
        kernel._download(ROOT, metas)
    assert downloaded == ["linux-image-6.1.0-50-amd64", "linux-image-6.1.0-50-rt-amd64"]


def test_host_only_variables_stay_outside() -> None:
    host = {"PATH": "/a:/sbin", "NOTIFY_SOCKET": "x", "BASH_FUNC_f%%": "() {", "HOME": "/h"}
    host["OPENBLAS_CORETYPE"] = "Haswell"
    env = job.environment(host, "tcg", ("can0", "can1"))
    assert env == {
        "PATH": "/a:/sbin:/usr/sbin",
        "HOME": "/h",
        "CANSHAPER_LANE": "tcg",
        "CANSHAPER_VCAN": "vcan0 vcan1",
        "CANSHAPER_VXCAN": "vxcan0 vxcan1",
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
