"""Requirements that no filter keeps: which conflict, and what is attainable."""

import re

import numpy as np
import pytest

from canshaper.design.tuning.conflict import explain, feasible_point
from canshaper.design.tuning.evaluate import gff, step_response
from canshaper.design.tuning.formulation import Requirements, Task
from canshaper.design.tuning.optimal import tune
from canshaper.design.tuning.program import Program
from canshaper.errors import InfeasibleError
from canshaper.shaping.sway import SwayMode

MODE = SwayMode.from_grapple(1.2, 120.0, 300.0)


@pytest.mark.slow
def test_run_on_against_output_within_the_command() -> None:
    with pytest.raises(InfeasibleError) as caught:
        tune(Task(MODE, require=Requirements(max_run_on_s=1.2)))
    text = str(caught.value)
    assert "run-on at most 1.2 s" in text
    assert "within the command" in text
    limits = {
        k: float(v) for k, v in re.findall(r"kept: (first jump|run-on) at most ([\d.]+)", text)
    }
    # The shortest run-on of all filters whose output stays within the command, by trying them.
    slow = np.geomspace(1.0, MODE.omega_rad_s, 60)
    shortest = min(
        int(np.flatnonzero(abs(np.array(y) - 1.0) > 0.05)[-1] + 1) * 0.02
        for q in slow
        for y in [step_response(MODE, 0.02, gff((-q, -(MODE.omega_rad_s**2) / q)))]
    )
    assert limits["run-on"] == pytest.approx(shortest, abs=0.021)
    tune(Task(MODE, require=Requirements(max_run_on_s=limits["run-on"] + 0.02)))
    jump = limits["first jump"] * 1.02
    tune(Task(MODE, require=Requirements(within_command=False, max_jump=jump, max_run_on_s=1.2)))


def test_bounds_on_single_poles() -> None:
    heavy = SwayMode(2.86, 0.3)
    with pytest.raises(
        InfeasibleError, match=r"pole distance \(14e\) asks for poles of 4.29 rad/s"
    ):
        tune(Task(heavy, require=Requirements(max_rate_per_s=1.0)))
    with pytest.raises(InfeasibleError, match="undamped"):
        tune(Task(SwayMode(2.86, 0.0), require=Requirements(pole_distance="printed")))
    with pytest.raises(InfeasibleError, match=r"14e, printed"):
        tune(Task(SwayMode(2.86, 0.001), require=Requirements(pole_distance="printed")))


@pytest.mark.slow
def test_third_pole_and_run_on() -> None:
    require = Requirements(third_pole=True, max_rate_per_s=5.0, max_run_on_s=1.2)
    program = Program(Task(MODE, 0.04, require=require))
    assert feasible_point(program) is None
    text = explain(program)
    assert "slope at most 5 full speeds/s" in text
    assert "attainable with the others kept: run-on at most" in text


def test_a_feasible_point_is_found_where_there_is_one() -> None:
    program = Program(Task(MODE, require=Requirements(max_run_on_s=1.9)))
    point = feasible_point(program)
    assert point is not None
    assert program.solve(point).success
