"""The rule that keeps `make test` short sees a slow test, a slow child and a slow fixture."""

from pathlib import Path

import pytest

from tests import budget

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[1]
LIMIT_S = 0.05
COSTLY_S = 0.15
TESTS = """
import subprocess, sys, time
import pytest

BURN = "import time\\nwhile time.process_time() < {s}: pass"

def burn():
    end = time.process_time() + {s}
    while time.process_time() < end:
        pass

@pytest.fixture(scope="module")
def shared():
    burn()
    yield
    burn()

def test_quick():
    pass

def test_own():
    burn()

def test_child():
    subprocess.run([sys.executable, "-c", BURN], check=True)

def test_with_a_fixture(shared):
    pass

@pytest.mark.slow
def test_marked():
    burn()
"""


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budget, "IMPORTED", ())
    monkeypatch.setattr(budget, "LIMIT_S", LIMIT_S)
    monkeypatch.setattr(budget, "speed", lambda: 1.0)
    monkeypatch.setattr(budget, "AGAIN", 0)


def run(pytester: pytest.Pytester, *arguments: str) -> tuple[int, str]:
    """Run the tests; return exit status and output."""
    pytester.makeini("[pytest]\nmarkers = slow: more than a second")
    pytester.makepyfile(test_costs=TESTS.format(s=COSTLY_S))
    ran = pytester.runpytest_inprocess("-p", "tests.budget", "-m", "not slow", *arguments)
    return int(ran.ret), ran.stdout.str()


def test_what_is_slow_and_not_marked_fails_the_run(pytester: pytest.Pytester) -> None:
    status, text = run(pytester, "--budget")
    assert status == pytest.ExitCode.TESTS_FAILED
    assert "4 passed, 1 deselected" in text
    for slow in ("test_own", "test_child", "fixture shared"):
        assert f"test_costs.py::{slow} takes" in text
    for quick in ("test_quick", "test_with_a_fixture", "test_marked"):
        assert f"test_costs.py::{quick} takes" not in text


def test_without_the_option_nothing_is_judged(pytester: pytest.Pytester) -> None:
    status, text = run(pytester)
    assert (status, "processor time" in text) == (pytest.ExitCode.OK, False)


def test_a_listed_test_runs_although_it_is_marked(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    listed = ["test_own", "test_child", "fixture shared", "test_marked"]
    listed = {f"test_costs.py::{name}": "shown here" for name in listed}
    monkeypatch.setattr(budget, "LISTED", listed)
    status, text = run(pytester, "--budget")
    assert status == pytest.ExitCode.OK
    assert "5 passed" in text


def test_a_list_that_is_too_long_fails_the_run(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(budget, "LISTED", {"test_costs.py::": "all"})
    monkeypatch.setattr(budget, "LISTED_S", COSTLY_S)
    status, text = run(pytester, "--budget")
    assert status == pytest.ExitCode.TESTS_FAILED
    assert "the list takes" in text


def test_a_name_that_is_no_test_fails_the_run(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(budget, "LIMIT_S", 10.0)
    monkeypatch.setattr(budget, "LISTED", {"test_costs.py::test_gone": "it was here"})
    status, text = run(pytester, "--budget")
    assert status == pytest.ExitCode.TESTS_FAILED
    assert "test_costs.py::test_gone of the list is no test that ran" in text


@pytest.mark.parametrize("again", [pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED])
def test_slow_once_is_measured_again_alone(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, again: pytest.ExitCode
) -> None:
    """The other process has the limits of the file, not those of this test."""
    monkeypatch.setattr(budget, "AGAIN", 2)
    monkeypatch.setattr(budget, "LISTED", {})
    if again == pytest.ExitCode.OK:
        monkeypatch.setenv("PYTHONPATH", str(ROOT))
    else:
        monkeypatch.setattr(budget.sys, "executable", "false")  # in no run is it quick
    status, text = run(pytester, "--budget")
    assert status == again
    assert ("takes" in text) == (again != pytest.ExitCode.OK)
