"""Tests of mutants: pytest collects once, then each mutant is a fork that runs what reaches it."""

import gc
import os
import shutil
import signal
import tempfile
from collections import Counter, defaultdict
from pathlib import Path

import pytest
from mutmut.mutation.trampoline import set_mutant_under_test
from mutmut.state import state
from mutmut.utils.format_utils import mangled_name_from_mutant_name

KILLER = "killer"
FAILED, UNREACHED = 1, 33  # as mutmut counts: a test failed; none of the tests calls the function


class Forks:
    """pytest plugin: instead of running the tests, run those of each mutant in a fork.

    The test that has killed most mutants of the same function goes first, then the shortest.

    Args:
        mutants: mutmut's names.
        processes: how many at a time.

    Attributes:
        exit_codes: by mutant: FAILED, UNREACHED, 0 if it survived, minus a signal of a time limit.
    """

    def __init__(self, mutants: list[str], processes: int) -> None:
        self.exit_codes: dict[str, int] = {}
        self._mutants = mutants
        self._processes = processes
        self._running: dict[int, tuple[str, str]] = {}  # mutant and its folder
        self._killed: defaultdict[str, Counter[str]] = defaultdict(Counter)  # by function and test

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run the tests of every mutant that reach its function; True: pytest runs none itself."""
        gc.freeze()  # else each fork copies what it collects
        for number, name in enumerate(self._mutants, 1):
            function = mangled_name_from_mutant_name(name)
            reaching = state().tests_by_mangled_function_name.get(function, set())
            killed = self._killed[function]
            items = sorted(
                (item for item in session.items if item.nodeid in reaching),
                key=lambda item: (-killed[item.nodeid], _duration_s(item)),
            )
            if not items:
                self.exit_codes[name] = UNREACHED
                continue
            if len(self._running) == self._processes:
                self._wait()
            self._start(name, items)
            print(f"{number} of {len(self._mutants)}: {name}", flush=True)
        while self._running:
            self._wait()
        return True

    def _start(self, name: str, items: list[pytest.Item]) -> None:
        temporary = tempfile.mkdtemp()
        pid = os.fork()
        if not pid:
            os.environ["PYTEST_DEBUG_TEMPROOT"] = temporary
            _run(name, items, Path(temporary) / KILLER)
        self._running[pid] = name, temporary

    def _wait(self) -> None:
        pid, status = os.wait()
        name, temporary = self._running.pop(pid)
        self.exit_codes[name] = os.waitstatus_to_exitcode(status)
        if not self.exit_codes[name]:
            print(f"survived: {name}", flush=True)
        killer = Path(temporary) / KILLER
        if killer.exists():
            print(f"killed: {name} by {killer.read_text()}", flush=True)
            self._killed[mangled_name_from_mutant_name(name)][killer.read_text()] += 1
        shutil.rmtree(temporary, ignore_errors=True)


class Verdict:
    """pytest plugin of a fork: ends its process, with FAILED, at the first test that fails.

    Args:
        killer: file that gets the name of that test.
    """

    def __init__(self, killer: Path) -> None:
        self._killer = killer

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """End the process where a test has failed."""
        if report.failed:
            self._killer.write_text(report.nodeid)
            os._exit(FAILED)


def _run(name: str, items: list[pytest.Item], killer: Path) -> None:
    """Run the tests with a mutant; end the process: 0, FAILED, or a signal of a time limit."""
    try:
        set_mutant_under_test(name)
        items[0].config.pluginmanager.register(Verdict(killer))
        for item, following in zip(items, [*items[1:], None], strict=True):
            # A loop that never ends, by processor time: four times what it takes without a mutant.
            signal.setitimer(signal.ITIMER_PROF, 1.0 + 4.0 * _duration_s(item))
            # One that waits for ever, by the clock: long, as a busy machine kills no survivor.
            signal.setitimer(signal.ITIMER_REAL, 20.0 + 30.0 * _duration_s(item))
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        os._exit(0)
    except BaseException:
        os._exit(FAILED)


def _duration_s(item: pytest.Item) -> float:
    duration_s: float = state().duration_by_test[item.nodeid]
    return duration_s
