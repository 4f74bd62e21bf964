"""Checks of the PC, on what real kernels and tools say.

The texts were read on Debian 12 (kernel 6.1, with and without PREEMPT_RT) in the lane of the tests
on SocketCAN, with PREEMPT_DYNAMIC, an hpet clock and zram swap there; governors and idle states are
in the kernel's documented format.
"""

from pathlib import Path

import pytest

from canshaper.commissioning.doctor import machine
from canshaper.commissioning.doctor.verdict import Finding, Level

DYNAMIC = "#1 SMP PREEMPT_DYNAMIC Debian 6.1.176-1 (2026-07-02)"
REAL_TIME = "#1 SMP PREEMPT_RT Debian 6.1.192-2 (2026-11-16)"
SWAPS = "Filename\t\t\t\tType\t\tSize\t\tUsed\t\tPriority\n"
ZRAM = "/dev/zram0                              partition\t614396\t\t{}\t\t-2\n"
CPU = "sys/devices/system/cpu/"
CLOCK = "sys/devices/system/clocksource/clocksource0/"


def write(root: Path, **files: str) -> None:
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


@pytest.mark.parametrize(
    ("version", "files", "level", "says"),
    [
        (REAL_TIME, {}, Level.OK, "PREEMPT_RT"),
        ("#1 SMP PREEMPT RT Debian 4.19", {}, Level.OK, "PREEMPT_RT"),
        ("#1 SMP", {"sys/kernel/realtime": "1\n"}, Level.OK, "PREEMPT_RT"),
        ("#1 SMP PREEMPT Thu", {}, Level.OK, "preemptible"),
        ("#1 SMP Debian 5.10.179-1 (2023-05-12)", {}, Level.WARNING, "does not let"),
        (DYNAMIC, {}, Level.NOTE, "PREEMPT_DYNAMIC"),
        (
            DYNAMIC,
            {"sys/kernel/debug/sched/preempt": "none (voluntary) full \n"},
            Level.WARNING,
            "mode voluntary",
        ),
        (
            DYNAMIC,
            {"sys/kernel/debug/sched/preempt": "none voluntary (full) \n"},
            Level.OK,
            "mode full",
        ),
        (DYNAMIC, {"proc/cmdline": "quiet preempt=full\n"}, Level.OK, "mode full"),
        (DYNAMIC, {"proc/cmdline": "quiet preempt=none\n"}, Level.WARNING, "mode none"),
        (DYNAMIC, {"proc/cmdline": "quiet nowatchdog tsc=reliable\n"}, Level.NOTE, "which mode"),
    ],
)
def test_preemption(
    tmp_path: Path, version: str, files: dict[str, str], level: Level, says: str
) -> None:
    write(tmp_path, **files)
    finding = machine.preemption(tmp_path, version)
    assert finding.level is level
    assert says in finding.found
    assert bool(finding.remedy) == (level is not Level.OK)


@pytest.mark.parametrize(
    ("runtime", "level"),
    [("950000", Level.OK), ("-1", Level.OK), ("100000", Level.WARNING), ("0", Level.BAD)],
)
def test_throttling(tmp_path: Path, runtime: str, level: Level) -> None:
    write(
        tmp_path,
        **{
            "proc/sys/kernel/sched_rt_runtime_us": f"{runtime}\n",
            "proc/sys/kernel/sched_rt_period_us": "1000000\n",
        },
    )
    assert machine.throttling(tmp_path).level is level


def test_a_system_that_reports_nothing_is_no_error(tmp_path: Path) -> None:
    for finding in (
        machine.throttling(tmp_path),
        machine.swap(tmp_path),
        machine.huge_pages(tmp_path),
        machine.governor(tmp_path),
        machine.idle_states(tmp_path, 20),
        machine.clock_source(tmp_path),
        machine.virtual(None, tmp_path),
        machine.processors(tmp_path, 2),
    ):
        assert finding.level in (Level.OK, Level.NOTE)


@pytest.mark.parametrize(
    ("lines", "level", "says"),
    [
        ("", Level.OK, "none"),
        (ZRAM.format(0), Level.OK, "not used"),
        (ZRAM.format(224256), Level.WARNING, "219 MiB"),
        (ZRAM.format(1024) + ZRAM.format(2048), Level.WARNING, "3 MiB"),
    ],
)
def test_swap(tmp_path: Path, lines: str, level: Level, says: str) -> None:
    write(tmp_path, **{"proc/swaps": SWAPS + lines})
    finding = machine.swap(tmp_path)
    assert finding.level is level
    assert says in finding.found


@pytest.mark.parametrize(
    ("modes", "level", "says"),
    [
        ("[always] madvise never", Level.NOTE, "always"),
        ("always [madvise] never", Level.OK, "madvise"),
        ("always madvise [never]", Level.OK, "never"),
    ],
)
def test_huge_pages_of_any_program_are_noted(
    tmp_path: Path, modes: str, level: Level, says: str
) -> None:
    write(tmp_path, **{"sys/kernel/mm/transparent_hugepage/enabled": f"{modes}\n"})
    finding = machine.huge_pages(tmp_path)
    assert finding.level is level
    assert finding.found.startswith(says)
    assert bool(finding.remedy) == (level is Level.NOTE)


def test_one_slow_processor_is_enough(tmp_path: Path) -> None:
    write(tmp_path, **{f"{CPU}cpu{i}/cpufreq/scaling_governor": "performance\n" for i in (0, 1)})
    assert machine.governor(tmp_path) == Finding("governor", Level.OK, "performance")
    write(tmp_path, **{f"{CPU}cpu1/cpufreq/scaling_governor": "powersave\n"})
    finding = machine.governor(tmp_path)
    assert finding.level is Level.WARNING
    assert finding.found.startswith("performance, powersave:")
    assert "cpupower" in finding.remedy


def idle_state(root: Path, number: int, name: str, latency_us: int, disable: int = 0) -> None:
    state = f"{CPU}cpu0/cpuidle/state{number}/"
    write(
        root,
        **{
            f"{state}name": f"{name}\n",
            f"{state}latency": f"{latency_us}\n",
            f"{state}disable": f"{disable}\n",
        },
    )


def test_the_deepest_idle_state_that_is_on_counts(tmp_path: Path) -> None:
    for number, (name, latency_us) in enumerate((("POLL", 0), ("C1", 2), ("C6", 133))):
        idle_state(tmp_path, number, name, latency_us)
    finding = machine.idle_states(tmp_path, 20)
    assert finding == Finding("idle states", Level.OK, "the deepest is C6, 133 us to wake up")
    assert machine.idle_states(tmp_path, 1).level is Level.WARNING
    idle_state(tmp_path, 2, "C6", 133, disable=1)
    assert "C1, 2 us" in machine.idle_states(tmp_path, 1).found


@pytest.mark.parametrize(
    ("current", "available", "level", "says"),
    [
        ("tsc", "tsc hpet acpi_pm", Level.OK, ""),
        ("arch_sys_counter", "arch_sys_counter", Level.OK, ""),
        ("hpet", "tsc hpet acpi_pm", Level.WARNING, "clocksource=tsc"),
        ("hpet", "hpet acpi_pm", Level.NOTE, ""),
    ],
)
def test_clock_source(
    tmp_path: Path, current: str, available: str, level: Level, says: str
) -> None:
    write(
        tmp_path,
        **{
            f"{CLOCK}current_clocksource": f"{current}\n",
            f"{CLOCK}available_clocksource": f"{available} \n",
        },
    )
    finding = machine.clock_source(tmp_path)
    assert finding.level is level
    assert current in finding.found
    assert says in finding.remedy


def test_suspend(tmp_path: Path) -> None:
    assert machine.suspend(tmp_path).level is Level.OK
    write(tmp_path, **{"sys/power/state": "\n"})
    assert machine.suspend(tmp_path) == Finding("suspend", Level.OK, "the kernel offers none")
    write(tmp_path, **{"sys/power/state": "freeze mem\n"})
    finding = machine.suspend(tmp_path)
    assert (finding.level, finding.remedy) == (Level.WARNING, "sudo systemctl mask sleep.target")
    assert finding.found == "possible (freeze mem); logind as it comes: the lid suspends"
    write(
        tmp_path,
        **{
            "etc/systemd/logind.conf": "[Login]\n#IdleAction=ignore\nHandleLidSwitch=ignore\n",
            "etc/systemd/logind.conf.d/idle.conf": "[Login]\nIdleAction=suspend\n",
        },
    )
    finding = machine.suspend(tmp_path)
    assert finding.found == "possible (freeze mem); HandleLidSwitch=ignore, IdleAction=suspend"
    masked = tmp_path / "etc/systemd/system/sleep.target"
    masked.parent.mkdir(parents=True)
    masked.write_text("[Unit]\n")
    assert machine.suspend(tmp_path).level is Level.WARNING
    masked.unlink()
    masked.symlink_to("/dev/null")
    assert machine.suspend(tmp_path) == Finding("suspend", Level.OK, "sleep.target is masked")


@pytest.mark.parametrize(
    ("hypervisor", "level"), [("qemu", Level.WARNING), ("kvm", Level.WARNING), ("none", Level.OK)]
)
def test_virtual_machine(tmp_path: Path, hypervisor: str, level: Level) -> None:
    finding = machine.virtual(hypervisor, tmp_path)
    assert finding.level is level
    assert finding.found.startswith(hypervisor)


def test_virtual_machine_without_the_tool(tmp_path: Path) -> None:
    write(tmp_path, **{"proc/cpuinfo": "processor\t: 0\nflags\t\t: fpu sse2 hypervisor lahf_lm\n"})
    assert machine.virtual(None, tmp_path).level is Level.WARNING
    write(tmp_path, **{"proc/cpuinfo": "processor\t: 0\nflags\t\t: fpu sse2 lahf_lm\n"})
    assert machine.virtual(None, tmp_path).level is Level.OK


def test_isolated_processors_are_reported(tmp_path: Path) -> None:
    write(tmp_path, **{f"{CPU}isolated": "\n"})
    assert machine.processors(tmp_path, 4).found == "4, isolated: none"
    write(tmp_path, **{f"{CPU}isolated": "2-3\n"})
    assert machine.processors(tmp_path, 4).found == "4, isolated: 2-3"


@pytest.mark.parametrize(
    ("load", "level"), [(0.1, Level.NOTE), (2.0, Level.NOTE), (2.1, Level.WARNING)]
)
def test_other_programs(load: float, level: Level) -> None:
    finding = machine.others(load, 2)
    assert finding.level is level
    assert finding.found.startswith(f"{load} processes")


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
    assert all(f.remedy for f in findings if f.level in (Level.WARNING, Level.BAD))
