import json
import math
import random
import subprocess
import sys
from itertools import pairwise

import pytest

from canshaper.report.metrics import AxisMetrics, compare, report_dict
from canshaper_sim.recording import AxisTrace, Recording
from tests.report.drives import Signal, sampled, zero


def stroke(t: float) -> float:
    return 1.0 if 1.0 <= t < 4.0 else 0.0


def one_axis(sway: Signal) -> Recording:
    return sampled(12.0, near_far=(stroke, stroke, stroke, sway))


def test_compare_known_reductions_over_different_time_bases() -> None:
    def drive(late_s: float, scale: float, duration_s: float, dt_s: float) -> Recording:
        def joystick(t: float) -> float:
            return stroke(t - late_s + 1e-9)

        def sway(t: float) -> float:
            rung = max(0.0, t - late_s - 4.0)
            return 16.0 * scale * math.exp(-0.1 * rung) * math.sin(2.8 * rung)

        lost = frozenset(range(7, 2000, 53))
        axes = {"near_far": (joystick, joystick, joystick, sway), "lift": (zero, zero, zero, None)}
        return sampled(duration_s, dt_s=dt_s, drop=lost, **axes)

    # The shaped drive was recorded earlier, longer and on a grid of its own.
    comparison = compare(drive(0.0, 1.0, 12.0, 0.02), drive(0.6, 0.25, 19.0, 0.0203))
    axis = comparison["near_far"]
    assert axis.peak_reduction_pct == pytest.approx(75.0, abs=0.2)
    assert axis.rms_reduction_pct == pytest.approx(75.0, abs=0.3)
    assert axis.residual_reduction_pct == pytest.approx(75.0, abs=0.2)
    assert axis.cross_residual_reduction_pct is None
    lift = comparison["lift"]
    assert lift.peak_reduction_pct is lift.rms_reduction_pct is lift.residual_reduction_pct is None
    assert lift.raw == AxisMetrics(*[None] * 11)


def test_a_swing_of_nothing_has_no_reduction_and_a_worse_one_is_negative() -> None:
    still, calm = one_axis(zero), one_axis(lambda t: 0.01 * (t > 4.0))
    assert compare(calm, still)["near_far"].peak_reduction_pct is None
    small = one_axis(lambda t: 1.0 * (t > 4.0))
    large = one_axis(lambda t: 3.0 * (t > 4.0))
    assert compare(small, large)["near_far"].residual_reduction_pct == pytest.approx(-200.0)


def test_report_is_json_without_nan(pair: tuple[Recording, Recording]) -> None:
    report = report_dict(
        *pair,
        transport="udp_multicast",
        missed_deadlines=0,
        facts={"seed": 3, "latency_ms": {"p99": float("nan"), "all": [1.0, float("inf")]}},
    )
    again = json.loads(json.dumps(report, allow_nan=False))
    assert again == report
    assert again["latency_ms"] == {"p99": None, "all": [1.0, None]}
    assert (again["transport"], again["missed_deadlines"], again["seed"]) == ("udp_multicast", 0, 3)
    assert again["duration_s"] == pytest.approx(37.0, abs=0.2)
    slew = again["axes"]["slew"]
    assert slew["time_to_95_s"] == slew["shaped"]["time_to_95_s"]
    assert slew["run_on_s"] == slew["shaped"]["run_on_s"]
    assert slew["residual_reduction_pct"] > 80.0
    assert set(slew["raw"]) == set(AxisMetrics.__annotations__)
    lift = again["axes"]["lift"]
    assert lift["peak_reduction_pct"] is None
    assert lift["raw"]["peak_deg"] is None
    assert lift["run_on_s"] == pytest.approx(0.27, abs=0.03)


def test_a_fact_may_not_hide_a_measure(pair: tuple[Recording, Recording]) -> None:
    with pytest.raises(ValueError, match="duration_s"):
        report_dict(*pair, transport="x", missed_deadlines=None, facts={"duration_s": 1.0})


def test_no_drive_gives_nan_or_fails() -> None:
    rng = random.Random(7)
    for _ in range(60):
        t_s = [0.02 * k for k in range(rng.randint(1, 300)) if k == 0 or rng.random() > 0.1]

        def noise(levels: list[float], length: int = len(t_s)) -> list[float]:
            return [value for value in levels for _ in range(length // len(levels) + 1)][:length]

        axes = {
            name: AxisTrace(
                noise([rng.choice([0.0, 0.0, 0.02, 0.3, 1.0, -1.0]) for _ in range(5)]),
                noise([rng.uniform(-1, 1) for _ in range(9)]),
                noise([rng.choice([0.0, 0.95, 0.05, -1.0]) for _ in range(9)]),
                noise([rng.uniform(-20, 20) for _ in range(30)]) if name != "lift" else None,
            )
            for name in ("near_far", "slew", "lift")
        }
        drive = Recording(t_s, axes)
        report = report_dict(drive, drive, transport="", missed_deadlines=None)
        assert "NaN" not in json.dumps(report)
        for axis in report["axes"].values():
            assert all(v is None or v >= 0.0 for k, v in axis["raw"].items() if "travel" not in k)
            assert axis["peak_reduction_pct"] in (None, 0.0)


def test_drives_that_cannot_be_compared() -> None:
    quiet = (zero, zero, zero, zero)
    with pytest.raises(ValueError, match="different axes"):
        compare(sampled(1.0, slew=quiet), sampled(1.0, near_far=quiet))
    empty = Recording([], {"slew": AxisTrace([], [], [], [])})
    with pytest.raises(ValueError, match="without samples"):
        compare(empty, empty)


def test_realistic_pair(pair: tuple[Recording, Recording]) -> None:
    assert any(b - a > 0.03 for a, b in pairwise(pair[0].t_s)), "the drive has lost samples"
    comparison = compare(*pair)
    for name in ("near_far", "slew"):
        axis = comparison[name]
        assert axis.residual_reduction_pct is not None
        assert 80.0 < axis.residual_reduction_pct < 95.0
        assert axis.raw.time_to_95_s == pytest.approx(0.41, abs=0.03)
        assert axis.raw.dip == axis.raw.re_rise == 0.0
        assert axis.shaped.dip is not None
        assert 0.25 < axis.shaped.dip < 0.4
    # Only the slew stroke swings the other plane: near-far was driven before, from rest.
    assert comparison["near_far"].raw.cross_residual_deg == 0.0
    assert comparison["slew"].cross_residual_reduction_pct is not None


def test_measures_and_table_need_neither_matplotlib_nor_numpy() -> None:
    code = (
        "import sys, canshaper.report.metrics, canshaper.report.console; "
        "sys.exit(bool({'matplotlib', 'numpy'} & sys.modules.keys()))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
