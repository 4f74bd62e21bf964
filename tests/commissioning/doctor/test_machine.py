"""Checks of the PC, on what real kernels and tools say.

The texts were read on Debian 12 (kernel 6.1, with and without PREEMPT_RT) in the lane of the tests
on SocketCAN, with PREEMPT_DYNAMIC, an hpet clock and zram swap there; governors and idle states are
in the kernel's documented format.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from canshaper.commissioning.doctor import machine
from canshaper.commissioning.doctor.verdict import Finding, Level

OK, NOTE, WARNING, BAD = Level.OK, Level.NOTE, Level.WARNING, Level.BAD
Check = Callable[[Path], Finding]
CPU = "sys/devices/system/cpu/"


def kernel(version: str) -> Check:
    return partial(machine.preemption, version=version)


def virtual(hypervisor: str | None) -> Check:
    return partial(machine.virtual, hypervisor)


def processors(root: Path) -> Finding:
    return machine.processors(root, 4)


DYNAMIC = kernel("#1 SMP PREEMPT_DYNAMIC Debian 6.1.176-1 (2026-07-02)")
IDLE = partial(machine.idle_states, tick_ms=20)
ZRAM = "/dev/zram0                              partition\t614396\t\t{}\t\t-2\n"


def preempt(text: str) -> dict[str, str]:
    return {"sys/kernel/debug/sched/preempt": f"{text} \n"}


def boot(words: str) -> dict[str, str]:
    return {"proc/cmdline": f"quiet {words}\n"}


def share(runtime: str) -> dict[str, str]:
    kernel = "proc/sys/kernel/sched_rt_"
    return {f"{kernel}runtime_us": f"{runtime}\n", f"{kernel}period_us": "1000000\n"}


def swap(*used: int) -> dict[str, str]:
    head = "Filename\t\t\t\tType\t\tSize\t\tUsed\t\tPriority\n"
    return {"proc/swaps": head + "".join(map(ZRAM.format, used))}


def pages(modes: str) -> dict[str, str]:
    return {"sys/kernel/mm/transparent_hugepage/enabled": f"{modes}\n"}


def governors(*names: str) -> dict[str, str]:
    return {f"{CPU}cpu{i}/cpufreq/scaling_governor": f"{n}\n" for i, n in enumerate(names)}


def clock(current: str, available: str) -> dict[str, str]:
    source = "sys/devices/system/clocksource/clocksource0/"
    return {
        f"{source}current_clocksource": f"{current}\n",
        f"{source}available_clocksource": f"{available} \n",
    }


def flags(words: str) -> dict[str, str]:
    return {"proc/cpuinfo": f"processor\t: 0\nflags\t\t: fpu sse2 {words}\n"}


def write(root: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


@pytest.mark.parametrize(
    ("check", "files", "level", "says"),
    [
        (kernel("#1 SMP PREEMPT_RT Debian 6.1.192-2 (2026-11-16)"), {}, OK, "PREEMPT_RT"),
        (kernel("#1 SMP PREEMPT RT Debian 4.19"), {}, OK, "PREEMPT_RT"),
        (kernel("#1 SMP"), {"sys/kernel/realtime": "1\n"}, OK, "PREEMPT_RT"),
        (kernel("#1 SMP PREEMPT Thu"), {}, OK, "preemptible"),
        (kernel("#1 SMP Debian 5.10.179-1 (2023-05-12)"), {}, WARNING, "does not let"),
        (DYNAMIC, {}, NOTE, "which mode it is in -> boot with preempt=full"),
        (DYNAMIC, preempt("none (voluntary) full"), WARNING, "mode voluntary"),
        (DYNAMIC, preempt("none voluntary (full)"), OK, "mode full"),
        (DYNAMIC, boot("preempt=full"), OK, "mode full"),
        (DYNAMIC, boot("preempt=none"), WARNING, "mode none"),
        (DYNAMIC, boot("nowatchdog tsc=reliable"), NOTE, "which mode"),
        (machine.throttling, share("950000"), OK, "95 %"),
        (machine.throttling, share("-1"), OK, "not limited"),
        (machine.throttling, share("100000"), WARNING, "10 %"),
        (machine.throttling, share("0"), BAD, "0 %"),
        (machine.throttling, {}, NOTE, "does not say"),
        (machine.swap, {}, OK, "none"),
        (machine.swap, swap(), OK, "none"),
        (machine.swap, swap(0), OK, "not used"),
        (machine.swap, swap(224256), WARNING, "219 MiB"),
        (machine.swap, swap(1024, 2048), WARNING, "3 MiB"),
        (machine.huge_pages, {}, OK, "none"),
        (machine.huge_pages, pages("[always] madvise never"), NOTE, "one for any program -> boot"),
        (machine.huge_pages, pages("always [madvise] never"), OK, "madvise"),
        (machine.huge_pages, pages("always madvise [never]"), OK, "never"),
        (machine.governor, {}, NOTE, "no frequency scaling"),
        (machine.governor, governors("performance", "performance"), OK, "performance"),
        (
            machine.governor,
            governors("performance", "powersave"),
            WARNING,
            "performance, powersave:",
        ),
        (IDLE, {}, OK, "none that takes time"),
        (machine.clock_source, {}, NOTE, "does not say"),
        (machine.clock_source, clock("tsc", "tsc hpet acpi_pm"), OK, "tsc"),
        (machine.clock_source, clock("arch_sys_counter", "arch_sys_counter"), OK, "arch_sys"),
        (
            machine.clock_source,
            clock("hpet", "tsc hpet acpi_pm"),
            WARNING,
            "-> boot with clocksource=tsc",
        ),
        (machine.clock_source, clock("hpet", "hpet acpi_pm"), NOTE, "hpet"),
        (virtual("qemu"), {}, WARNING, "qemu"),
        (virtual("kvm"), {}, WARNING, "kvm"),
        (virtual("none"), {}, OK, "none"),
        (virtual(None), {}, OK, "none"),
        (virtual(None), flags("hypervisor lahf_lm"), WARNING, "a hypervisor"),
        (virtual(None), flags("lahf_lm"), OK, "none"),
        (processors, {}, NOTE, "4, isolated: none"),
        (processors, {f"{CPU}isolated": "\n"}, NOTE, "4, isolated: none"),
        (processors, {f"{CPU}isolated": "2-3\n"}, NOTE, "4, isolated: 2-3"),
        (lambda _root: machine.others(0.1, 2), {}, NOTE, "0.1 processes"),
        (lambda _root: machine.others(2.0, 2), {}, NOTE, "2.0 processes"),
        (lambda _root: machine.others(2.1, 2), {}, WARNING, "2.1 processes"),
    ],
)
def test_a_check(
    tmp_path: Path, check: Check, files: dict[str, str], level: Level, says: str
) -> None:
    write(tmp_path, files)
    finding = check(tmp_path)
    assert finding.level is level
    assert says in f"{finding.found} -> {finding.remedy}"
    assert finding.remedy or level in (OK, NOTE)
    assert level is not OK or not finding.remedy


def test_the_deepest_idle_state_that_is_on_counts(tmp_path: Path) -> None:
    def state(number: int, name: str, latency_us: int, disable: int = 0) -> None:
        values = {"name": name, "latency": latency_us, "disable": disable}
        of = f"{CPU}cpu0/cpuidle/state{number}/"
        write(tmp_path, {f"{of}{key}": f"{value}\n" for key, value in values.items()})

    for number, (name, latency_us) in enumerate((("POLL", 0), ("C1", 2), ("C6", 133))):
        state(number, name, latency_us)
    assert IDLE(tmp_path) == Finding("idle states", OK, "the deepest is C6, 133 us to wake up")
    assert machine.idle_states(tmp_path, 1).level is WARNING
    state(2, "C6", 133, disable=1)
    assert "C1, 2 us" in machine.idle_states(tmp_path, 1).found


def test_suspend(tmp_path: Path) -> None:
    assert machine.suspend(tmp_path).level is OK
    write(tmp_path, {"sys/power/state": "\n"})
    assert machine.suspend(tmp_path) == Finding("suspend", OK, "the kernel offers none")
    write(tmp_path, {"sys/power/state": "freeze mem\n"})
    finding = machine.suspend(tmp_path)
    assert (finding.level, finding.remedy) == (WARNING, "sudo systemctl mask sleep.target")
    assert finding.found == "possible (freeze mem); logind as it comes: the lid suspends"
    write(
        tmp_path,
        {
            "etc/systemd/logind.conf": "[Login]\n#IdleAction=ignore\nHandleLidSwitch=ignore\n",
            "etc/systemd/logind.conf.d/idle.conf": "[Login]\nIdleAction=suspend\n",
        },
    )
    finding = machine.suspend(tmp_path)
    assert finding.found == "possible (freeze mem); HandleLidSwitch=ignore, IdleAction=suspend"
    masked = tmp_path / "etc/systemd/system/sleep.target"
    masked.parent.mkdir(parents=True)
    masked.write_text("[Unit]\n")
    assert machine.suspend(tmp_path).level is WARNING
    masked.unlink()
    masked.symlink_to("/dev/null")
    assert machine.suspend(tmp_path) == Finding("suspend", OK, "sleep.target is masked")


def test_all_checks_work_on_this_machine() -> None:
    findings = machine.machine_findings(20)
    assert [f.subject for f in findings] == [
        "kernel",
        "real-time share",
        "swap",
        "huge pages",
        "governor",
        "idle states",
        "clock source",
        "suspend",
        "virtual machine",
        "processors",
        "other programs",
        "Python",
    ]
    assert all(f.found for f in findings)
    assert all(f.remedy for f in findings if f.level in (WARNING, BAD))
