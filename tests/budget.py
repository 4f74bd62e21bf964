"""Shows what makes `make test` long: tests of more than a second of a processor without a mark.

With ``--budget`` the run ends with the tests whose own and child processes take longer, unless
LISTED names them with a reason. It does not fail for them: how long a test takes is a fact of the
machine and of what else it does. What takes longer gets the mark ``slow``, which those of LISTED
lose; a name of LISTED that is no test fails the run. A fixture that several tests share is a row of
its own, "fixture NAME". The libraries that take long to import are loaded before the first test.
"""

import importlib
import resource
import time
from collections.abc import Iterator, Mapping
from typing import Any

import pytest

LIMIT_S = 1.0
SHOWN = 10  # slow tests, the slowest first
# Slow tests that every run of `make test` has, by the beginning of their names.
STUDIO = "tests/studio/test_server.py::test_every_shipped_machine_is_driven_with_all_its_axes"
PAGE = "tests/studio/test_browser.py"
KILLED = "tests/commissioning/test_killed_writers.py::test_killed_at_any_call_into_the_kernel"
FAMILIES = ("forwarder-robust", "j1939-forwarder", "canopen-forwarder", "two-cranes")
LISTED: Mapping[str, str] = {
    "tests/blackbox/test_sequences.py::test_what_is_played_is_the_same[forwarder-robust": "replay",
    "tests/campaign/test_cli.py::test_drives_are_summed_up_and_kept": "a campaign",
    "tests/closed_loop/test_motion.py::test_a_motion_moves_no_axis_back": "both axes as one motion",
    "tests/closed_loop/test_sway_sensor_slewing.py::test_a_slew_is_damped": "with a sensor",
    "tests/closed_loop/test_twin.py::test_both_axes_at_fourteen": "a crane that shares no code",
    "tests/commissioning/calibration/test_together_driven.py::test_the_pump_of_the": "the verb",
    "tests/commissioning/identification/test_identify_command.py::test_empty_and_loaded": "swings",
    f"{KILLED}[calibrated": "never half a file",
    "tests/commissioning/procedure/test_commission.py::test_answers_come_from_a_file": "the whole",
    "tests/controller/test_any_frames.py": "whatever frames come, nothing moves unasked",
    "tests/docs/test_commands.py::test_a_page_shows_what_the_command_prints[README": "read first",
    "tests/shaping/test_axis_properties.py::TestAxisUnderWatch": "the promises of an axis",
    f"{PAGE}::fixture ": "a browser and a studio for it",
    f"{PAGE}::test_it_loads_without_an_error_and_requests_nothing_elsewhere[dark": "the live page",
    f"{PAGE}::test_keys_drive_both_cranes_and_the_shaped_one_swings_less": "a drive by the page",
    "tests/studio/test_server.py::fixture shared": "the studio, as a process",
    "tests/commissioning/identification/test_identify_command.py::fixture logs": "swings",
    **{f"{STUDIO}[{name}": "one machine of a family" for name in FAMILIES},
}
IMPORTED = ("scipy.signal", "scipy.optimize", "matplotlib.pyplot", "casadi", "cantools", "mujoco")
PROPERTY = "processor_s"


def used() -> float:
    """Processor time of this process and of its children that have ended, s."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


class Meter:
    """Measures each test; runs in every process that runs tests."""

    def __init__(self) -> None:
        self._begin = 0.0
        self._shared: dict[str, float] = {}  # since the begin of this test, by fixture

    def pytest_sessionstart(self) -> None:
        for name in IMPORTED:
            try:
                importlib.import_module(name)
            except ImportError:  # an extra that is not installed: its tests say so
                continue

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_logstart(self) -> None:
        self._begin = used()
        self._shared = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(
        self, fixturedef: pytest.FixtureDef[Any], request: pytest.FixtureRequest
    ) -> Iterator[None]:
        if fixturedef.scope == "function":
            return (yield)
        name, ended = fixturedef.argname, 0.0

        # Finalizers run last in, first out: this one last, `ending` first.
        fixturedef.addfinalizer(lambda: self._charge(name, used() - ended))
        begin, inner = used(), sum(self._shared.values())
        try:
            return (yield)
        finally:
            self._charge(name, used() - begin - (sum(self._shared.values()) - inner))

            def ending() -> None:
                nonlocal ended
                ended = used()

            fixturedef.addfinalizer(ending)

    def _charge(self, fixture: str, seconds: float) -> None:
        self._shared[fixture] = self._shared.get(fixture, 0.0) + seconds

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item, call: pytest.CallInfo[None]) -> Any:
        report = yield
        if call.when == "teardown":
            own = used() - self._begin - sum(self._shared.values())
            rows = {item.nodeid: own}
            place = item.nodeid.partition("::")[0]
            rows |= {f"{place}::fixture {name}": s for name, s in self._shared.items()}
            report.user_properties.append((PROPERTY, rows))
        return report


class Report:
    """Collects what the meters measured and shows it at the end; runs in the first process."""

    def __init__(self) -> None:
        self._rows: dict[str, float] = {}
        self._gone: list[str] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        for name, value in report.user_properties:
            if name == PROPERTY:
                for row, seconds in value.items():
                    self._rows[row] = self._rows.get(row, 0.0) + seconds

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        files = {row.partition("::")[0] for row in self._rows}
        self._gone = [
            name
            for name in LISTED
            if name.partition("::")[0] in files and not any(r.startswith(name) for r in self._rows)
        ]
        if self._gone and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        total = sum(self._rows.values())
        listed = {row: s for row, s in self._rows.items() if row.startswith(tuple(LISTED))}
        terminalreporter.write_line(
            f"processor time {total:.0f} s, of it {sum(listed.values()):.0f} s of the list in "
            "tests/budget.py"
        )
        slow = [row for row, s in self._rows.items() if s > LIMIT_S and row not in listed]
        for row in sorted(slow, key=self._rows.__getitem__, reverse=True)[:SHOWN]:
            terminalreporter.write_line(f"slow, not marked: {row} {self._rows[row]:.2f} s")
        for name in self._gone:
            terminalreporter.write_line(f"FAILED {name} of the list is no test that ran", red=True)


@pytest.hookimpl(tryfirst=True)  # before -m selects
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Take the mark off the tests of the list: they are part of `make test`."""
    for item in items:
        if item.nodeid.startswith(tuple(LISTED)):
            item.own_markers = [mark for mark in item.own_markers if mark.name != "slow"]


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add --budget."""
    parser.addoption("--budget", action="store_true", help="show the tests of a second and more")


def pytest_configure(config: pytest.Config) -> None:
    """Measure in every process, report in the first."""
    if not config.getoption("--budget"):
        return
    first = not hasattr(config, "workerinput")
    if first:
        config.pluginmanager.register(Report(), "canshaper-budget-report")
    if not first or not config.getoption("numprocesses", None):
        config.pluginmanager.register(Meter(), "canshaper-budget-meter")
