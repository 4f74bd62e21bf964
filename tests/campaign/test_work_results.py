"""``canshaper work``: practice, tasks, tables, and the command as a person uses it."""

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from canshaper.campaign import work_results
from canshaper.campaign.work import AXES, LOADS, Move, SetUp, Work, do_work
from canshaper.campaign.work_results import (
    OFF,
    TASKS,
    Task,
    as_data,
    at_work,
    choice,
    do_all,
    gain,
    practised,
    table,
)
from canshaper_sim.operator_model import Operators
from tests.campaign.work import ROBUST, WITHIN, known, source, works
from tests.cli.invocation import invoke
from tests.rigs.files import CONFIG


def test_practice_chooses_the_fastest_technique_of_each_load() -> None:
    def do(trials: Sequence[Work]) -> dict[Work, list[Move]]:
        """Empty it is best to be fast, with a log to be slow, and to catch by half."""
        results = {}
        for one in trials:
            speed, catch = one.techniques[0]
            assert catch <= one.skill.catch
            slower = abs(catch - 0.5 * one.skill.catch)
            seconds = dict(zip(LOADS, (9.0 - speed, 8.0 + speed), strict=True))
            results[one] = [Move(load, True, seconds[load] + slower) for load in LOADS]
        return results

    people = {name: getattr(Operators(), name) for name in ("catching", "waiting", "novice")}
    set_ups = [SetUp(bypass=bypass) for bypass in (True, False)]
    chosen = practised(source(), set_ups, people, WITHIN, do)
    assert [(one.set_up, one.operator) for one in chosen] == [*product(set_ups, people)]
    for one in chosen:
        catch = 0.5 if one.operator == "catching" else 0.0
        assert one.techniques == ((1.0, catch), (0.25, catch))
        assert one.skill == getattr(Operators(), one.operator)
    assert sum(chosen[0].known[0].fall) < 0.25 * sum(chosen[3].known[0].fall)


TWO = {name: TASKS[name] for name in ("loading", "tip only")}


class Doing:
    """An engine whose moves last as long as the set-up's name says; Ctrl-C comes at some work."""

    def __init__(self, interrupted_at: float = math.inf) -> None:
        self.seen: list[Work] = []
        self._last = interrupted_at

    def run(self, _work: Any, jobs: Iterable[Any]) -> Iterator[Any]:
        for one in jobs:
            self.seen.append(one)
            if len(self.seen) > self._last:
                raise KeyboardInterrupt
            seconds = {"off": 9.0, "": 7.0}[one.set_up.name]
            yield one, [Move(load, True, seconds) for load in LOADS]


@pytest.fixture
def learned(monkeypatch: pytest.MonkeyPatch) -> None:
    """The operator knows its best technique after practice."""
    monkeypatch.setattr(work_results, "learn", lambda *_: known(bypass=True))


@pytest.mark.usefixtures("learned")
def test_each_set_up_does_the_task_with_its_own_moves() -> None:
    engine, heads = Doing(), list[str | None]()
    tasks = {"still": Task("waiting", (0.2, 3.0))}
    moves, interrupted = at_work(
        engine, source(), (OFF, SetUp()), tasks, lambda _, what=None: heads.append(what), seeds=3
    )
    assert interrupted == ""
    assert {one: [move.seconds for move in done] for one, done in moves["still"].items()} == {
        OFF: [9.0] * 6,
        SetUp(): [7.0] * 6,
    }
    assert {one.operator for one in engine.seen} == {"waiting"}
    assert {one.within for one in engine.seen} == {(0.2, 3.0)}
    assert {one.seed for one in engine.seen[-6:]} == {"0", "1", "2"}
    assert [one for one in heads if one] == ["20 cm, 3 deg: practice", "20 cm, 3 deg: work"]


@pytest.mark.usefixtures("learned")
def test_interrupted_it_keeps_the_cycles_that_every_set_up_has_done() -> None:
    whole = Doing()
    at_work(whole, source(), (OFF, SetUp()), TWO, lambda *_: None, seeds=2)
    first = sum(one.within[1] == 6.0 for one in whole.seen)
    engine = Doing(first - 1)  # the last of the second cycle is not done
    moves, interrupted = at_work(engine, source(), (OFF, SetUp()), TWO, lambda *_: None, seeds=2)
    assert {name: [len(one) for one in done.values()] for name, done in moves.items()} == {
        "loading": [2, 2]
    }
    assert interrupted == "30 cm, 6 deg: 1 of 2 working cycles are done"
    assert [row.header for row in choice("s", TWO, moves)[0].columns] == ["s", "30 cm\n6 deg"]
    moves, interrupted = at_work(Doing(2), source(), (OFF, SetUp()), TWO, lambda *_: None, seeds=2)
    assert (moves, interrupted) == ({}, "30 cm, 6 deg: 0 of 2 working cycles are done")
    assert not choice("s", TWO, moves)[0].rows


@pytest.mark.usefixtures("learned")
def test_where_only_the_tip_counts_no_one_practises_to_catch() -> None:
    engine = Doing()
    at_work(engine, source(), (OFF,), TWO, lambda *_: None, seeds=1)
    tried = {
        within: {one.techniques[0][1] for one in engine.seen if one.within[1] == within}
        for within in (6.0, math.inf)
    }
    assert tried == {6.0: {0.0, 0.5, 1.0}, math.inf: {0.0}}


def test_what_is_slower_than_off_is_red_and_said() -> None:
    def moves(empty_s: float, log_s: float) -> list[Move]:
        return [Move("empty", True, empty_s), Move("log", True, log_s)]

    precise, own = SetUp("precise"), SetUp()
    still = {OFF: moves(9.0, 9.5), own: moves(6.0, 7.0), precise: moves(8.0, 12.0)}
    tip = {OFF: moves(4.0, 4.1), own: moves(5.0, 4.0), precise: moves(4.0, 4.0)}
    drawn, slower = choice("s", TWO, {"loading": still, "tip only": tip})
    heads = [one.header for one in drawn.columns]
    cells: list[list[Any]] = [[*one.cells] for one in drawn.columns]
    assert heads == ["s", "30 cm\n6 deg", "30 cm\ntip only"]
    assert cells[0] == ["off", "normal", "precise"]
    assert [(one.plain, one.style) for one in cells[1]] == [
        ("9.0 / 9.5", ""),
        ("6.0 / 7.0", "bold"),
        ("8.0 / 12.0", "red"),
    ]
    assert [one.style for one in cells[2]] == ["", "red", ""]
    assert slower == [
        "normal: 0.5 s a move slower than off at 30 cm, tip only",
        "precise: 0.8 s a move slower than off at 30 cm, 6 deg",
    ]
    assert as_data({"loading": still})["loading"]["normal"] == {"empty": 6.0, "log": 7.0}


def test_a_gain_is_that_of_the_pairs() -> None:
    assert gain([10.0, 20.0, 30.0], [8.0, 16.0, 24.0]) == pytest.approx((-20.0, -20.0, -20.0))
    change, low, high = gain([10.0, 12.0, 8.0, 11.0], [9.0, 13.0, 6.0, 10.0])
    assert change == pytest.approx(-7.317, abs=0.01)
    assert low < change < high
    assert low > -26.0
    assert high < 9.0


def test_a_table_has_each_operator_and_load_off_and_on() -> None:
    done = {}
    for bypass in (True, False):
        for seed in ("0", "1"):
            late = 10.0 if bypass else 5.0
            moves = [
                Move(load, True, late + number, 3, 1.25, 20.0, 0.1)
                for number, load in enumerate(LOADS)
            ]
            done[works(bypass=bypass, seed=seed)] = [*moves, moves[0]._replace(done=False)]
    drawn = table(done)
    cells = [[*column.cells] for column in drawn.columns]
    assert cells[0] == ["catching, empty", "catching, log"]
    assert cells[1] == ["10.0 / 5.0", "11.0 / 6.0"]
    assert cells[2] == ["-50 (-50..-50)", "-45 (-45..-45)"]
    assert cells[3:] == [
        ["50 / 50", "100 / 100"],
        *[[f"{one} / {one}"] * 2 for one in ("3.0", "1.2", "20", "0.10")],
    ]


def test_all_work_is_in_its_order_whoever_is_ready_first() -> None:
    class Backwards:
        """An engine whose last job is done first."""

        def run(self, work: Any, jobs: Any) -> Iterator[Any]:
            assert work.func is do_work
            yield from ((one, [Move("log", taps=int(one.seed))]) for one in [*jobs][::-1])

    shown: list[float] = []
    ones = [works(bypass=False, seed=str(seed)) for seed in range(3)]
    done = do_all(Backwards(), source(), lambda part, what=None: shown.append(part), ones)
    assert [moves[0].taps for moves in done.values()] == [0, 1, 2]
    assert shown == pytest.approx([1 / 3, 2 / 3, 1.0])


run = partial(invoke, "work", columns=200)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--tolerance", "0.5", "6"), "--tolerance: expected 1 .. 300 cm, got 0.5"),
        (("--tolerance", "30", "91"), "--tolerance: expected 0.5 .. 90 degrees, got 91"),
        (("--tolerance", "nan", "6"), "--tolerance: expected 1 .. 300 cm, got nan"),
        (
            ("--operator", "novice.reaction_s=0"),
            "operator: reaction_s: expected 0.05 .. 1.0, got 0.0",
        ),
        (("--operator", "novice.skill=1"), "--operator novice.skill=1: expected a parameter, got"),
        (("--operator", "waiting.aim_m=far"), "expected a number, got 'far'"),
        (("--set", "pump=1"), "--set pump=1: expected a parameter, got 'pump'"),
        (("--seeds", "1"), "greater than or equal to 2"),
        ((str(CONFIG / "forwarder-joints.yaml"),), f"expected axes {' and '.join(AXES)}"),
        (("--picture", "a.txt"), "--picture: expected a file with .png or .svg or .pdf"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_driven(
    arguments: tuple[str, ...], text: str
) -> None:
    done = run(*arguments)
    assert done.exit_code == 2
    assert text in done.output
    assert "Traceback" not in done.output


@pytest.mark.slow
def test_operators_work_and_are_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(work_results, "_SPEEDS", (0.6, 1.0))
    monkeypatch.setattr(work_results, "_CATCHES", (0.0, 1.0))
    monkeypatch.setattr(work_results, "_PRACTICE", 1)
    picture, report = tmp_path / "work.png", tmp_path / "work.html"
    written = ("--picture", str(picture), "--report", str(report))
    done = run(ROBUST, "--seeds", "2", "--tolerance", "30", "6", *written)
    assert done.exit_code == 0, done.output
    assert picture.stat().st_size > 20_000
    assert "catching, log" in report.read_text()
    rows = [
        line.split() for line in done.output.splitlines() if ", empty" in line or ", log" in line
    ]
    assert [row[0] for row in rows] == ["catching,"] * 2 + ["waiting,"] * 2 + ["novice,"] * 2
    assert all(float(row[2]) > float(row[4]) for row in rows)
