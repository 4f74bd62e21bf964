"""The PC itself: what kernel, processor and interpreter do to a loop with deadlines.

Each check takes the root of the file system, or the text that a tool prints, so that a test can ask
about another machine.
"""

import os
import platform
import re
import subprocess
import sys
from pathlib import Path

from canshaper.commissioning.doctor.verdict import Finding, Level

# Clock sources that are read without leaving the processor.
QUICK_CLOCKS = frozenset(
    ("tsc", "arch_sys_counter", "kvm-clock", "hyperv_clocksource_tsc_page", "timebase")
)
# Every kind of suspend of systemd needs sleep.target.
MASK_SLEEP = "sudo systemctl mask sleep.target"
# A processor that takes longer than this part of the tick to wake up is late by itself.
WAKE_SHARE = 0.1


def _read(file: Path) -> str | None:
    """Return the text of a file of the kernel; None where it cannot be read."""
    try:
        return file.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return None


def machine_findings(tick_ms: int) -> list[Finding]:
    """Run all checks of this machine."""
    root = Path("/")
    number = os.cpu_count() or 1
    return [
        preemption(root, platform.version()),
        throttling(root),
        swap(root),
        huge_pages(root),
        governor(root),
        idle_states(root, tick_ms),
        clock_source(root),
        suspend(root),
        virtual(_virtualisation(), root),
        processors(root, number),
        others(os.getloadavg()[0], number),
        interpreter(),
    ]


def preemption(root: Path, version: str) -> Finding:
    """Check how soon the kernel lets a real-time process run.

    ``version`` is the kernel's version text, ``uname -v``.
    """
    real_time = "linux-image-rt-amd64 or the like of the distribution"
    if re.search(r"PREEMPT[_ ]RT", version) or _read(root / "sys/kernel/realtime") == "1":
        return Finding("kernel", Level.OK, "PREEMPT_RT")
    if "PREEMPT_DYNAMIC" not in version:
        if re.search(r"\bPREEMPT\b", version):
            return Finding("kernel", Level.OK, "preemptible (PREEMPT)")
        text = "does not let a real-time process interrupt it"
        return Finding("kernel", Level.WARNING, text, f"install a PREEMPT_RT kernel ({real_time})")
    modes = _read(root / "sys/kernel/debug/sched/preempt") or ""
    mode = re.search(r"\((\w+)\)", modes) or re.search(
        r"\bpreempt=(\w+)", _read(root / "proc/cmdline") or ""
    )
    if mode is None:
        text = "PREEMPT_DYNAMIC; /sys/kernel/debug/sched/preempt has for root which mode it is in"
        return Finding("kernel", Level.NOTE, text, "boot with preempt=full to be sure")
    text = f"PREEMPT_DYNAMIC in mode {mode[1]}"
    if mode[1] in ("full", "lazy"):
        return Finding("kernel", Level.OK, text)
    remedy = f"boot with preempt=full, or install a PREEMPT_RT kernel ({real_time})"
    return Finding("kernel", Level.WARNING, text, remedy)


def throttling(root: Path) -> Finding:
    """Check how much of the time the kernel gives to real-time processes."""
    runtime = _read(root / "proc/sys/kernel/sched_rt_runtime_us")
    period = _read(root / "proc/sys/kernel/sched_rt_period_us")
    if runtime is None or period is None:
        return Finding("real-time share", Level.NOTE, "the kernel does not say")
    if runtime == "-1":
        return Finding("real-time share", Level.OK, "not limited")
    share = int(runtime) / int(period)
    text = f"{100 * share:.0f} % of the time"
    if share >= 0.5:
        return Finding("real-time share", Level.OK, text)
    remedy = "sudo sysctl kernel.sched_rt_runtime_us=950000"
    return Finding("real-time share", Level.BAD if share == 0 else Level.WARNING, text, remedy)


def swap(root: Path) -> Finding:
    """Check for memory that was written out, and is slow to come back."""
    lines = (_read(root / "proc/swaps") or "").splitlines()[1:]
    used_kib = sum(int(line.split()[3]) for line in lines)
    if not lines:
        return Finding("swap", Level.OK, "none")
    if used_kib == 0:
        return Finding("swap", Level.OK, "there, and not used")
    text = f"{used_kib / 1024:.0f} MiB in use: memory is short"
    cure = "more memory or fewer programs; then sudo swapoff -a. The daemon's own memory is locked"
    return Finding("swap", Level.WARNING, text, cure)


def huge_pages(root: Path) -> Finding:
    """Check whether the kernel joins memory into pages of 2 MiB, which nothing can interrupt.

    The daemon refuses it for its own memory; for other programs it happens on any processor.
    """
    modes = _read(root / "sys/kernel/mm/transparent_hugepage/enabled") or ""
    mode = re.search(r"\[(\w+)\]", modes)
    if mode is None:
        return Finding("huge pages", Level.OK, "none")
    if mode[1] != "always":
        return Finding("huge pages", Level.OK, mode[1])
    text = "always: the kernel may hold up the loop for 1 ms when it makes one for any program"
    remedy = "boot with transparent_hugepage=madvise"
    return Finding("huge pages", Level.NOTE, text, remedy)


def governor(root: Path) -> Finding:
    """Check whether the processors slow down when there is little to do."""
    files = sorted((root / "sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor"))
    names = {text for file in files if (text := _read(file))}
    if not names:
        text = "no frequency scaling is to be seen (fixed, or set from outside of this system)"
        return Finding("governor", Level.NOTE, text)
    text = ", ".join(sorted(names))
    if names == {"performance"}:
        return Finding("governor", Level.OK, text)
    text += ": the processor is slow when the loop wakes up"
    remedy = "sudo cpupower frequency-set -g performance, at every boot"
    return Finding("governor", Level.WARNING, text, remedy)


def idle_states(root: Path, tick_ms: int) -> Finding:
    """Check which part of a tick the deepest sleep of a processor takes to wake up from."""
    deepest_us, name = 0, ""
    for state in (root / "sys/devices/system/cpu").glob("cpu[0-9]*/cpuidle/state*"):
        latency = _read(state / "latency")
        if latency and _read(state / "disable") in ("0", None) and int(latency) > deepest_us:
            deepest_us, name = int(latency), _read(state / "name") or state.name
    if not name:
        return Finding("idle states", Level.OK, "none that takes time to wake up from")
    text = f"the deepest is {name}, {deepest_us} us to wake up"
    if deepest_us <= WAKE_SHARE * tick_ms * 1000:
        return Finding("idle states", Level.OK, text)
    remedy = "sudo cpupower idle-set -D 100, or boot with intel_idle.max_cstate=1"
    return Finding("idle states", Level.WARNING, text, remedy)


def clock_source(root: Path) -> Finding:
    """Check how quickly the kernel reads the time."""
    directory = root / "sys/devices/system/clocksource/clocksource0"
    name = _read(directory / "current_clocksource")
    if name is None:
        return Finding("clock source", Level.NOTE, "the kernel does not say")
    if name in QUICK_CLOCKS:
        return Finding("clock source", Level.OK, name)
    others = (_read(directory / "available_clocksource") or "").split()
    better = [other for other in others if other in QUICK_CLOCKS]
    if better:
        remedy = f"boot with clocksource={better[0]}, unless the kernel's log calls it unstable"
        return Finding("clock source", Level.WARNING, f"{name}, which is slow to read", remedy)
    return Finding("clock source", Level.NOTE, name)


def suspend(root: Path) -> Finding:
    """Check whether lid, key or an idle desktop can suspend the machine."""
    states = _read(root / "sys/power/state")
    if not states:
        return Finding("suspend", Level.OK, "the kernel offers none")
    target = root / "etc/systemd/system/sleep.target"
    if target.is_symlink() and target.readlink() == Path("/dev/null"):
        return Finding("suspend", Level.OK, "sleep.target is masked")
    files = [root / "etc/systemd/logind.conf"]
    files += sorted((root / "etc/systemd/logind.conf.d").glob("*.conf"))
    text = "\n".join(_read(file) or "" for file in files)
    lines = re.findall(r"^\s*((?:HandleLidSwitch|IdleAction)=\S+)", text, re.MULTILINE)
    set_to = ", ".join(lines) or "logind as it comes: the lid suspends"
    return Finding("suspend", Level.WARNING, f"possible ({states}); {set_to}", MASK_SLEEP)


def virtual(hypervisor: str | None, root: Path) -> Finding:
    """Check whether another system decides when this one runs.

    ``hypervisor`` is what ``systemd-detect-virt --vm`` says; None where there is no such program.
    """
    if hypervisor is None and re.search(
        r"^flags\b.*\bhypervisor\b", _read(root / "proc/cpuinfo") or "", re.MULTILINE
    ):
        hypervisor = "a hypervisor"
    if hypervisor in (None, "none"):
        return Finding("virtual machine", Level.OK, "none is to be seen")
    text = f"{hypervisor}: its host decides when this system runs"
    remedy = "run the crane on a PC without one, or give the machine processors of its own"
    return Finding("virtual machine", Level.WARNING, text, remedy)


def _virtualisation() -> str | None:
    try:
        done = subprocess.run(
            ["systemd-detect-virt", "--vm"], capture_output=True, text=True, check=False
        )
    except OSError:
        return None
    return done.stdout.strip() or None


def processors(root: Path, number: int) -> Finding:
    """Check how many processors there are, and which of them are kept free."""
    isolated = _read(root / "sys/devices/system/cpu/isolated")
    text = f"{number}, isolated: {isolated or 'none'}"
    return Finding("processors", Level.NOTE, text)


def others(load: float, number: int) -> Finding:
    """Check how many processes wanted to run before the first run, whose figures include them.

    Args:
        load: processes that ran or waited for a processor, mean of a minute.
        number: of processors.
    """
    text = f"{load:.1f} processes ran or waited on {number} processors"
    if load <= number:
        return Finding("other programs", Level.NOTE, text)
    remedy = "top shows which; end those that the machine does not need"
    return Finding("other programs", Level.WARNING, f"{text}: idle was not idle", remedy)


def interpreter() -> Finding:
    """Check the Python that runs the loop, and whether it is a debug build."""
    text = f"{platform.python_implementation()} {platform.python_version()}"
    if hasattr(sys, "gettotalrefcount"):
        remedy = "take the ordinary build"
        return Finding("Python", Level.WARNING, f"{text}, a debug build", remedy)
    return Finding("Python", Level.NOTE, f"{text}; garbage collector frozen while the loop runs")
