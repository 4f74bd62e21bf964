"""Work on the processes of this machine: every job once, whatever becomes of a process."""

import multiprocessing
import os
import signal
from collections.abc import Iterator
from functools import partial
from itertools import count
from pathlib import Path

import pytest

from canshaper.design.parallel import Processes
from canshaper.errors import CampaignError
from tests.campaign.jobs import always_dies, dies_once, fails, fails_or_stays, square

pytestmark = pytest.mark.processes


@pytest.mark.parametrize("count", [1, 2])
def test_every_job_has_its_result_once(count: int) -> None:
    results = list(Processes(count).run(square, range(50)))
    assert sorted(results) == [(n, n * n) for n in range(50)]


def test_jobs_are_taken_a_few_ahead_only() -> None:
    received: list[int] = []
    jobs = (received.append(n) or n for n in range(1000))
    results = Processes(2).run(square, jobs)
    for _ in range(5):
        next(results)
    assert len(received) < 20
    results.close()  # type: ignore[attr-defined]


def test_a_process_that_is_killed_loses_no_job_and_none_counts_twice(tmp_path: Path) -> None:
    results = list(Processes(2).run(partial(dies_once, tmp_path / "died"), range(40)))
    assert (tmp_path / "died").exists()
    assert sorted(results) == [(n, n * n) for n in range(40)]


def test_a_job_that_kills_every_process_ends_the_work() -> None:
    with pytest.raises(CampaignError, match="the process died 3 times of"):
        list(Processes(2).run(always_dies, range(40)))


@pytest.mark.parametrize("count", [1, 2])
def test_what_a_job_raises_is_raised(count: int) -> None:
    with pytest.raises(ValueError, match="no square of"):
        list(Processes(count).run(fails, range(3)))


def test_processes_end_that_take_no_sigterm() -> None:
    """As those that are forked by a program with a handler of its own, such as a page's server."""
    before = signal.signal(signal.SIGTERM, lambda *_: None)
    try:
        with pytest.raises(ValueError, match="no square of"):
            list(Processes(2).run(fails_or_stays, range(2)))
    finally:
        signal.signal(signal.SIGTERM, before)
    assert not multiprocessing.active_children()


def test_ctrl_c_in_the_midst_of_handing_out_ends_the_processes() -> None:
    def jobs() -> Iterator[int]:
        for number in count():
            if number == 7:
                os.kill(os.getpid(), signal.SIGINT)  # no exception here, nor in the pool's lines
            yield number

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            list(Processes(2).run(square, jobs()))
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert not multiprocessing.active_children()
