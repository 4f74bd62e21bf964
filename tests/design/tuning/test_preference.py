"""One number from quicker to calmer: a front of settings, and the one that it chooses."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from canshaper.design.tuning.deploy import setting
from canshaper.design.tuning.evaluate import Machine, evaluate, gff
from canshaper.design.tuning.formulation import Requirements, Task
from canshaper.design.tuning.plot import figure
from canshaper.design.tuning.preference import Choice, chosen, front, table
from canshaper.errors import DesignError, InfeasibleError
from canshaper.machine.binding import load_deployment
from canshaper.report.console import SafeConsole
from canshaper.shaping.shapers.gff import denominator_from_poles
from canshaper.shaping.sway import SwayMode

MODE = SwayMode.from_grapple(1.2, 120.0, 300.0)
MACHINE = Machine.of(
    load_deployment(Path(__file__).parents[3] / "config" / "forwarder.yaml").axes["near_far"]
)
TASK = Task(MODE, require=Requirements(max_rate_per_s=5.0))
STEPS = [k / 10.0 for k in range(11)]


@pytest.fixture(scope="module")
def choices() -> list[Choice]:
    return front(TASK, MACHINE, 0.5)


@pytest.mark.slow
def test_no_setting_of_the_front_beats_another_one(choices: list[Choice]) -> None:
    for one in choices:
        for other in choices:
            assert other is one or any(a < b for a, b in zip(one.felt, other.felt, strict=True))
    assert all(one.measures.peak <= 1.001 for one in choices)
    assert len(choices) > 10


@pytest.mark.slow
def test_more_of_it_is_never_quicker_and_never_rougher(choices: list[Choice]) -> None:
    felt = [chosen(choices, step).felt for step in STEPS]
    for (rise, run_on, dip, left), (rise_2, run_on_2, dip_2, left_2) in pairwise(felt):
        assert rise + run_on <= rise_2 + run_on_2
        assert dip + left >= dip_2 + left_2
    assert felt[0][0] == min(one.felt[0] for one in choices)
    assert felt[0][0] < 0.7 * felt[-1][0]
    assert felt[-1][2] < 0.05
    assert felt[0][2] > 0.6
    assert len(set(felt)) >= 5


@pytest.mark.slow
def test_the_optimum_of_two_poles_is_no_better_than_the_front(choices: list[Choice]) -> None:
    one = evaluate(MODE, 0.02, gff((-2.859, -2.859)), MACHINE, (-10, 0, 10))
    mine = (one.rise_s, one.mean_delay_s, one.dip, one.worst())
    assert any(all(a <= b for a, b in zip(c.felt, mine, strict=True)) for c in choices)


@pytest.mark.slow
def test_a_front_keeps_what_is_required() -> None:
    require = replace(TASK.require, third_pole=True, max_jump=0.15, max_run_on_s=1.9)
    choices = front(replace(TASK, require=require), MACHINE, 0.0)
    assert {len(one.poles_rad_s) for one in choices} == {3}
    assert max(one.measures.first_jump for one in choices) <= 0.15
    assert max(one.measures.run_on_s for one in choices) <= 1.9
    with pytest.raises(InfeasibleError, match="no poles keep all requirements"):
        front(replace(TASK, require=replace(require, max_run_on_s=0.3)), MACHINE, 0.0)


@pytest.mark.parametrize("wrong", [-0.1, 1.1, float("nan")])
def test_a_preference_out_of_range_says_the_range(wrong: float) -> None:
    with pytest.raises(
        DesignError, match=r"^preference \(0 quickest, 1 calmest\): expected 0 to 1"
    ):
        front(TASK, MACHINE, wrong)


@pytest.mark.slow
def test_table_and_picture_have_the_front(choices: list[Choice]) -> None:
    console = SafeConsole(width=80, record=True)
    console.print(table(choices, 0.3, 2.0))
    rows = [line.split() for line in console.export_text().splitlines() if " -" in line]
    assert [row[0] for row in rows] == ["0", "0.25", "0.3", "0.5", "0.75", "1"]
    one = chosen(choices, 0.3)
    assert float(rows[2][-3]) == pytest.approx(2.0 * one.measures.mean_delay_s, abs=0.005)
    first, second, *third = one.poles_rad_s
    a1, a2 = denominator_from_poles((first, second))
    numbers = {"a1": a1 * 1.000001, "a2": a2, "third_pole_rad_s": third[0] if third else None}
    drawn = setting(**numbers, mode=MODE, tick_s=0.02, machine=MACHINE)  # type: ignore[arg-type]

    def panels(front: list[Choice]) -> Figure:
        names = {"axis": "near_far", "setting": drawn, "mode": MODE, "tick_s": 0.02}
        return figure(**names, machine=MACHINE, full_speed_m_s=1.0, choices=front)  # type: ignore[arg-type]

    assert (len(panels([]).axes), len(panels(choices).axes)) == (3, 4)
    dots = panels(choices).axes[-1].lines[0].get_xydata()
    assert dots is not None
    assert len(dots) == len(choices)
