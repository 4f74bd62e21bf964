"""Command and limits of a run, alike for every lane."""

import os
import re
import shlex
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

VCAN = ("vcan0", "vcan1")
VXCAN = ("vxcan0", "vxcan1")  # one pair: a queue (tc) works on it, unlike on vcan
CAN_BITRATE = 250_000  # J1939 on mobile machinery
SBIN = ("/usr/sbin", "/sbin")  # ip, modprobe, tc; absent from an ordinary user's PATH

# Variables that speak of this host's session: terminals, desktops, service managers; and of its
# processor, which is not the emulated one: code for another ends with an illegal instruction.
HOST_ONLY = re.compile(
    r"_|SHLVL|OLDPWD|PWD|DISPLAY|WAYLAND_DISPLAY|XAUTHORITY|SSH_.*|DBUS_.*|XDG_RUNTIME_DIR"
    r"|XDG_SESSION.*|NOTIFY_SOCKET|WATCHDOG_.*|LISTEN_.*|INVOCATION_ID|JOURNAL_STREAM|TMUX.*"
    r"|OPENBLAS_CORETYPE|NPY_DISABLE_CPU_FEATURES"
)
SHELL_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@dataclass(frozen=True)
class Job:
    """One command with everything that its lane must know."""

    command: tuple[str, ...]
    cwd: Path
    writable: tuple[Path, ...] = ()  # host directories that the command may write to (tcg)
    timeout_s: float = 900.0  # for the command; 0: none
    grace_s: float = 10.0  # between asking the command to end and ending it
    boot_timeout_s: float = 300.0  # some 100 times what a boot takes, 30 times one with systemd
    memory_mib: int = 1024
    kernel: str = "std"  # or "rt", PREEMPT_RT
    systemd: bool = False  # a real systemd is PID 1, the command a service
    bench: bool = False  # clocks count executed instructions: repeatable latencies
    steady: bool = False  # clocks count instructions, and the processor is never idle
    kvaser: int = 2  # emulated controllers; each pair shares one bus
    kernel_args: tuple[str, ...] = ()
    verbose: bool = False

    def script(self, lane: str, can: Iterable[str]) -> str:
        """Return the shell script that becomes the command, with this environment and cwd."""
        env = environment(os.environ, lane, can)
        if self.systemd:
            env["CANSHAPER_SYSTEMD"] = "1"
        if self.bench:
            env["PYTHONHASHSEED"] = "0"  # the order of sets changes the number of instructions
        lines = [f"cd {shlex.quote(str(self.cwd))} || exit 126"]
        lines += [f"export {name}={shlex.quote(value)}" for name, value in env.items()]
        lines += [f"exec {shlex.join(self.command)}"]
        return "\n".join(lines) + "\n"


def environment(host: Mapping[str, str], lane: str, can: Iterable[str]) -> dict[str, str]:
    """Return the command's environment: the host's, where it holds inside, and the lane's own."""
    env = {
        name: value
        for name, value in host.items()
        if SHELL_NAME.fullmatch(name) and not HOST_ONLY.fullmatch(name)
    }
    path = env.get("PATH", "/usr/local/bin:/usr/bin:/bin").split(":")
    env["PATH"] = ":".join(path + [folder for folder in SBIN if folder not in path])
    env["CANSHAPER_LANE"] = lane
    env["CANSHAPER_VCAN"] = " ".join(VCAN)
    env["CANSHAPER_VXCAN"] = " ".join(VXCAN)
    env["CANSHAPER_CAN"] = " ".join(can)
    return env


def can_names(kvaser: int) -> tuple[str, ...]:
    """Return the interface names of so many emulated controllers."""
    return tuple(f"can{i}" for i in range(kvaser))


def ip_batch(can: Iterable[str]) -> str:
    """Return the ``ip -batch`` lines that bring every interface up."""
    lines = ["link set lo up"]
    for name in VCAN:
        # mtu 72: a vcan that carries CAN FD frames too
        lines += [f"link add {name} type vcan", f"link set {name} mtu 72", f"link set {name} up"]
    first, second = VXCAN
    lines += [f"link add {first} type vxcan peer name {second}"]
    for name in VXCAN:
        lines += [f"link set {name} mtu 72", f"link set {name} up"]
    for name in can:
        lines += [f"link set {name} type can bitrate {CAN_BITRATE}", f"link set {name} up"]
    return "\n".join(lines) + "\n"
