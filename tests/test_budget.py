"""A slow test, a slow child and a slow fixture of `make test` are shown; none fails the run."""

import pytest

from tests import budget

pytestmark = pytest.mark.slow
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


def run(pytester: pytest.Pytester, *arguments: str) -> tuple[int, str]:
    """Run the tests; return exit status and output."""
    pytester.makeini("[pytest]\nmarkers = slow: more than a second")
    pytester.makepyfile(test_costs=TESTS.format(s=COSTLY_S))
    ran = pytester.runpytest_inprocess("-p", "tests.budget", "-m", "not slow", *arguments)
    return int(ran.ret), ran.stdout.str()


def test_slow_tests_without_a_mark_are_shown(pytester: pytest.Pytester) -> None:
    status, text = run(pytester, "--budget")
    assert status == pytest.ExitCode.OK
    assert "4 passed, 1 deselected" in text
    for slow in ("test_own", "test_child", "fixture shared"):
        assert f"not marked: test_costs.py::{slow} 0." in text
    for quick in ("test_quick", "test_with_a_fixture", "test_marked"):
        assert f"not marked: test_costs.py::{quick} 0." not in text


def test_without_the_option_nothing_is_shown(pytester: pytest.Pytester) -> None:
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
    assert "not marked" not in text


def test_a_name_that_is_no_test_fails_the_run(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(budget, "LIMIT_S", 10.0)
    monkeypatch.setattr(budget, "LISTED", {"test_costs.py::test_gone": "it was here"})
    status, text = run(pytester, "--budget")
    assert status == pytest.ExitCode.TESTS_FAILED
    assert "test_costs.py::test_gone of the list is no test that ran" in text
