"""Garbage collector and memory: what the kernel and the interpreter really do."""

import gc
import os
import resource
import subprocess
import sys
import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from canshaper.daemon import realtime
from canshaper.daemon.realtime import Collector

pytestmark = pytest.mark.processes

ANSWER_S = 60.0  # only to end a test that hangs


class Cycle:
    """Garbage that only a collector finds."""

    def __init__(self) -> None:
        self.itself = self


@pytest.fixture
def collector() -> Iterator[Collector]:
    yield Collector()
    gc.unfreeze()
    gc.enable()


# -- collector -------------------------------------------------------------------------------------


def test_what_is_there_at_the_start_is_never_looked_through_again(collector: Collector) -> None:
    kept = [[i] for i in range(1000)]
    collector.freeze()
    assert gc.get_freeze_count() > len(kept)
    assert sum(len(gc.get_objects(generation)) for generation in range(3)) < 1000


def test_garbage_of_the_start_is_collected_first(collector: Collector) -> None:
    gone = weakref.ref(Cycle())
    collector.freeze()
    assert gone() is None


def test_a_second_start_looks_at_what_came_since_and_at_nothing_else(collector: Collector) -> None:
    """All that is there takes longer to look through than a tick lasts."""
    old = Cycle()
    gone = weakref.ref(old)
    collector.freeze()
    del old
    since = weakref.ref(Cycle())
    kept = [[i] for i in range(1000)]
    collector.freeze()
    assert gone() is not None
    assert since() is None
    assert gc.get_freeze_count() > len(kept)
    assert sum(len(gc.get_objects(generation)) for generation in range(3)) < 1000


def test_nothing_is_collected_in_the_loop(collector: Collector) -> None:
    collector.freeze()
    collections = [generation["collections"] for generation in gc.get_stats()]
    kept = [weakref.ref(Cycle()) for _ in range(20_000)]
    assert not gc.isenabled()
    assert all(one() is not None for one in kept)
    assert [generation["collections"] for generation in gc.get_stats()] == collections


def test_a_pause_collects_what_came_since(collector: Collector) -> None:
    collector.freeze()
    collector.pause(0)
    gone = weakref.ref(Cycle())
    collector.pause(Collector.PERIOD_NS - 1)
    assert gone() is not None
    collector.pause(Collector.PERIOD_NS)
    assert gone() is None
    gone = weakref.ref(Cycle())
    collector.pause(2 * Collector.PERIOD_NS - 1)
    assert gone() is not None
    collector.pause(2 * Collector.PERIOD_NS)
    assert gone() is None


def test_a_pause_does_not_look_through_what_is_frozen(collector: Collector) -> None:
    old = Cycle()
    gone = weakref.ref(old)
    collector.freeze()
    del old
    collector.pause(0)
    assert gone() is not None


def test_it_stays_off_when_a_library_switches_it_on(collector: Collector) -> None:
    collector.freeze()
    gc.enable()
    collector.pause(0)
    assert not gc.isenabled()


# -- memory ----------------------------------------------------------------------------------------

# Everything is imported before ``prepare`` may take the right to read it away.
IMPORT = "import ctypes, os, resource, sys\nfrom canshaper.daemon.realtime import lock_memory\n"
LOCK = """
print(lock_memory())
more = bytearray(4 << 20)
print(open("/proc/self/status").read())
"""
KB = 1024
CAP_IPC_LOCK = 14  # linux/capability.h


def lock(prepare: str = "") -> tuple[str, int, int]:
    """Output of a process that locks its memory and then takes 4 MB; kB locked, kB in all."""
    result = subprocess.run(
        [sys.executable, "-c", IMPORT + prepare + LOCK],
        capture_output=True,
        text=True,
        check=True,
        timeout=ANSWER_S,
    )
    said, _, status = result.stdout.partition("\n")
    fields = dict(line.split(":", 1) for line in status.splitlines() if ":" in line)
    return said, int(fields["VmLck"].split()[0]), int(fields["VmSize"].split()[0])


def may_lock() -> bool:
    """Whether a process started here may lock any amount of memory."""
    soft, _hard = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    status = Path("/proc/self/status").read_text(encoding="ascii")
    effective = next(row.split()[1] for row in status.splitlines() if row.startswith("CapEff"))
    return bool(int(effective, 16) >> CAP_IPC_LOCK & 1) or soft == resource.RLIM_INFINITY


def test_memory_is_locked_also_what_is_taken_later() -> None:
    if not may_lock():
        pytest.skip("neither CAP_IPC_LOCK nor an unlimited RLIMIT_MEMLOCK")
    said, locked, size = lock()
    assert said == "None"
    assert locked > 4 * KB
    assert locked > 0.9 * size  # all but what the kernel itself puts there


def test_huge_pages_are_refused_and_by_children_too() -> None:
    code = (
        "import subprocess\nfrom canshaper.daemon.realtime import refuse_huge_pages\n"
        "show = ['grep', 'THP_enabled', '/proc/self/status']\n"
        "subprocess.run(show)\nrefuse_huge_pages()\nsubprocess.run(show)\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=ANSWER_S
    )
    assert result.stdout.split() == ["THP_enabled:", "1", "THP_enabled:", "0"]


def test_below_a_limit_nothing_is_locked() -> None:
    """Memory needed later would be refused, and the daemon would end in the middle of its work."""
    limit = (
        "hard = resource.getrlimit(resource.RLIMIT_MEMLOCK)[1]\n"
        "limit = 64 << 20 if hard == resource.RLIM_INFINITY else hard\n"
        "resource.setrlimit(resource.RLIMIT_MEMLOCK, (limit, limit))\n"
    )
    drop = "os.setgid(65534); os.setuid(65534)\n" if os.geteuid() == 0 else ""
    said, locked, _size = lock(limit + drop)
    assert said == "RLIMIT_MEMLOCK is not unlimited"
    assert locked == 0


def test_a_refusal_of_the_kernel_is_reported() -> None:
    """A root by name only, as containers have it: the limit holds for him."""
    if os.geteuid() != 0:
        pytest.skip("not root: below a limit the kernel is not asked")
    drop = (  # PR_CAPBSET_DROP; the bounding set acts at the next execve
        f"assert ctypes.CDLL(None).prctl(24, {CAP_IPC_LOCK}, 0, 0, 0) == 0\n"
        "resource.setrlimit(resource.RLIMIT_MEMLOCK, (65536, 65536))\n"
        f"os.execv(sys.executable, [sys.executable, '-c', {IMPORT + LOCK!r}])\n"
    )
    said, locked, _size = lock(drop)
    assert said == "Cannot allocate memory"
    assert locked == 0


# -- priority and rights ---------------------------------------------------------------------------


class Library:
    """Keeps what the kernel would be asked for."""

    def capset(self, header: Any, data: Any) -> None:
        self.header, self.data = [*header], [*data]


def test_what_the_loop_does_not_need_of_roots_rights_is_given_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    library = Library()
    monkeypatch.setattr(realtime.ctypes, "CDLL", lambda _name: library)
    realtime.drop_capabilities()
    status = Path("/proc/self/status").read_text(encoding="ascii")
    permitted = int(status.partition("CapPrm:")[2].split()[0], 16)
    kept = permitted & sum(1 << one for one in realtime.NEEDED)
    assert library.header == [0x20080522, 0]
    assert library.data == [kept, kept, 0, 0, 0, 0]


def test_the_kernel_takes_them() -> None:
    code = "from canshaper.daemon.realtime import *; drop_capabilities()"
    code += "; print(open('/proc/self/status').read())"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=ANSWER_S)
    fields = dict(line.split(":", 1) for line in done.stdout.splitlines() if ":" in line)
    assert fields["CapEff"] == fields["CapPrm"]
    assert int(fields["CapEff"], 16) & ~sum(1 << one for one in realtime.NEEDED) == 0


def test_the_priority_is_that_of_the_loop_alone_or_the_log_says_why(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    taken: list[tuple[int, int, int]] = []
    monkeypatch.setattr(
        realtime.os,
        "sched_setscheduler",
        lambda *one: taken.append((*one[:2], one[2].sched_priority)),
    )
    realtime.take_priority(40)
    assert taken == [(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, 40)]

    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(realtime.os, "sched_setscheduler", refuse)
    realtime.take_priority(40)
    assert caplog.messages == ["priority=ordinary (Operation not permitted)"]
