"""The comparison of filters: what is driven and what is measured."""

import os
import signal
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest

from canshaper.design.comparison.manoeuvres import (
    RANDOM_SEEDS,
    Candidate,
    candidates,
    manoeuvres,
    with_candidate,
)
from canshaper.design.comparison.measure import measure, measure_all
from canshaper.machine.deployment import Deployment
from canshaper.shaping.registry import KINDS
from canshaper_sim.operator import SCRIPTS
from tests.cli.invocation import invoke
from tests.design.comparison.candidates import FILE, ROBUST, task
from tests.rigs.files import CONFIG


@pytest.mark.slow
def test_every_filter_of_the_registry_takes_part_on_both_axes(deployment: Deployment) -> None:
    every = candidates(deployment)
    for axis in ("slew", "near_far"):
        assert {c.filters[axis].kind for c in every} == set(KINDS)
    assert len({c.name for c in every}) == len(every)
    apart = ["G_FF 3rd pole apart", "robust 1.8 s apart"]
    assert [c.name for c in every if c.ours and not c.motion] == apart
    assert not next(c for c in every if c.name == "off").motion
    without = candidates(replace(deployment, motions={}))
    assert [c.name for c in without] == [c.name for c in every][:-2]


def test_manoeuvres_end_in_rest_and_cover_what_they_should() -> None:
    tasks = manoeuvres()
    assert len({t.name for t in tasks}) == len(tasks)
    works = [t.work for t in tasks]
    assert works.count("random") == len(RANDOM_SEEDS) == 12
    assert {t.script.axes for t in tasks if t.work == "random"} == {("slew", "near_far")}
    for work in ("pulse", "tap", "reversal"):
        alone = {t.script.axes for t in tasks if t.work == work}
        assert alone == {("slew",), ("near_far",)}
    for both in (t for t in tasks if t.work in ("both", "gain", "cycle", "load", "pump")):
        assert {"slew", "near_far"} <= set(both.script.axes)
    for one in tasks:
        assert one.script.duration_s - max(s.end_s for s in one.script.strokes) >= 5.0


def test_the_load_is_picked_up_while_the_joysticks_are_neutral() -> None:
    load = task("load picked up")
    assert load.load_s is not None
    assert all(load.script.command(axis, load.load_s) == 0.0 for axis in load.script.axes)
    before, after = (
        [s for s in load.script.strokes if (s.start_s < load.load_s) is first]
        for first in (True, False)
    )
    assert before
    assert after
    assert set(load.script.strokes) < set(SCRIPTS["loading"].strokes)


@pytest.mark.slow
def test_a_pulse_with_robust_and_off(deployment: Deployment, by_name: dict[str, Candidate]) -> None:
    pulse = task("pulse near-far")
    off = measure(deployment, by_name["off"], pulse, 0)
    assert off.residual_deg == pytest.approx(16.0, abs=0.5)
    assert off.peak_deg == pytest.approx(21.8, abs=0.5)
    assert off.path == pytest.approx(3.0, abs=0.05)
    robust = measure(deployment, by_name[ROBUST], pulse, 0)
    assert robust.residual_deg <= 0.15
    assert robust.peak_deg <= 5.0
    assert robust.stop_s is not None
    assert robust.stop_s <= 1.9
    assert robust.run_on_m == pytest.approx(0.87, abs=0.05)
    assert robust.dip is not None
    assert robust.dip <= 0.02
    longer = measure(deployment, by_name[ROBUST], pulse, 15)
    assert robust.residual_deg < longer.residual_deg < 1.5
    # Half a radian a second on 9.6 m is 4.8 m/s.
    slew = measure(deployment, by_name["off"], task("pulse slew"), 0)
    assert slew.run_on_m is not None
    assert off.run_on_m is not None
    assert slew.run_on_m == pytest.approx(4.8 * off.run_on_m, rel=0.05)


def test_residual_swing_is_that_of_both_planes(
    deployment: Deployment, by_name: dict[str, Candidate]
) -> None:
    """A slew without compensation leaves swing along the boom, which no filter of slew sees."""
    pulse = task("pulse slew")
    assert measure(deployment, by_name[ROBUST], pulse, 0).residual_deg < 0.2
    apart = measure(deployment, by_name["robust 1.8 s apart"], pulse, 0)
    assert apart.residual_deg > 2.0


def test_both_axes_need_the_motion(deployment: Deployment, by_name: dict[str, Candidate]) -> None:
    both = task("both -1.2 s out")
    assert measure(deployment, by_name[ROBUST], both, 0).residual_deg < 0.4
    assert measure(deployment, by_name["robust 1.8 s apart"], both, 0).residual_deg > 3.0


def test_movements_of_a_tap_are_counted(
    deployment: Deployment, by_name: dict[str, Candidate]
) -> None:
    """The two impulses of ZV are half a swing apart, and the tap is shorter than that."""
    tap = task("tap 0.15 s 100 % near-far")
    moves = {n: measure(deployment, by_name[n], tap, 0).movements for n in ("off", "ZV", ROBUST)}
    assert moves == {"off": 1, "ZV": 2, ROBUST: 1}


@pytest.mark.slow
def test_a_load_and_a_slow_valve_change_the_crane(
    deployment: Deployment, by_name: dict[str, Candidate]
) -> None:
    for name, less in (("load picked up", {"load_s": None}), ("slow slew", {})):
        changed = task(name)
        usual = replace(changed, crane=task("pulse slew").crane, **less)
        left = measure(deployment, by_name[ROBUST], changed, 0).residual_deg
        assert left > 1.0
        assert measure(deployment, by_name[ROBUST], usual, 0).residual_deg < 0.5 * left


def test_initial_sway_hangs_along_the_boom(
    deployment: Deployment, by_name: dict[str, Candidate]
) -> None:
    swinging = measure(deployment, by_name[ROBUST], task("swinging"), 0)
    assert 3.0 < swinging.residual_deg < 5.0
    assert swinging.peak_deg >= 10.0


@pytest.mark.slow
def test_processes_give_what_one_gives(
    deployment: Deployment, by_name: dict[str, Candidate]
) -> None:
    every = [by_name["off"], by_name[ROBUST]]
    tap = task("tap 0.6 s 20 % slew")
    seen: list[float] = []
    outcomes = measure_all(FILE, every, [tap], on_progress=seen.append, processes=2)
    assert outcomes == [measure(deployment, c, tap, 0) for c in every]
    assert seen == [0.5, 1.0]


def test_a_candidate_gets_time_to_run_on(
    deployment: Deployment, by_name: dict[str, Candidate]
) -> None:
    changed = with_candidate(deployment, by_name["ZV"])
    for axis in ("slew", "near_far"):
        assert changed.axes[axis].config.limits.tail_s == 3.0
        assert changed.axes[axis].config.filter == by_name["ZV"].filters[axis]
    assert changed.axes["lift"] is deployment.axes["lift"]
    assert changed.motions == deployment.motions
    assert with_candidate(deployment, by_name["off"]).motions == {}


def test_an_out_that_is_a_file_is_reported_before_anything_is_driven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def drives(*_arguments: object, **_options: object) -> None:
        raise AssertionError

    monkeypatch.setattr("canshaper.design.comparison.measure.measure_all", drives)
    (tmp_path / "out").touch()
    done = invoke("compare", "--out", tmp_path / "out")
    assert (done.exit_code, done.output) == (2, f"{tmp_path / 'out'}: File exists\n")


def test_a_machine_without_slew_and_near_far_is_not_compared(tmp_path: Path) -> None:
    file = str(CONFIG / "forwarder-joints.yaml")
    done = invoke("compare", file, "--out", tmp_path)
    assert done.exit_code == 2
    says = "expected axes slew and near_far, or a crane with a rope, got slew, lift_cylinder"
    assert says in done.output
    assert not list(tmp_path.iterdir())


# Ctrl-C is ignored in a shell's background job, such as a build's.
COMPARE = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from canshaper.design.comparison import measure
of_file = measure._deployment
def loaded(file):
    if not of_file.cache_info().currsize:
        print("works\\n", end="", flush=True)  # in one piece: two processes print
    return of_file(file)
measure._deployment = loaded
from canshaper.cli.app import app
app(["compare", sys.argv[1], "--out", sys.argv[2], "--processes", "2"])
"""


@pytest.mark.slow
@pytest.mark.parametrize("to_all", [True, False], ids=["terminal", "parent"])
def test_ctrl_c_leaves_no_process_behind(to_all: bool, tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", COMPARE, str(FILE), str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == process.stdout.readline() == "works\n"
        (os.killpg if to_all else os.kill)(process.pid, signal.SIGINT)
        # The pipes are at their end when the last process is gone.
        out, err = process.communicate(timeout=60)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    assert (process.returncode, out, err) == (130, "", "interrupted\n")
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)
    assert not list(tmp_path.iterdir())
