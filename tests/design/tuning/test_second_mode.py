"""A second mode in the robust design, on a double pendulum: rotator above, grapple with logs below.

The pendulum has its own equations (Lagrange, nonlinear) and SciPy's integration; it shares nothing
with the design but the modes that an eigenvalue problem gives.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from canshaper.config.adjust import AxisKey, adjusted
from canshaper.config.filters import SecondMode
from canshaper.design.tuning.evaluate import Machine
from canshaper.design.tuning.modes import second_mode
from canshaper.design.tuning.robust import least_residual, shortest
from canshaper.machine.binding import load_deployment
from canshaper.machine.valves import BoundAxis
from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.registry import build_shaper
from canshaper.shaping.states import CommandInput
from canshaper.shaping.sway import SwayMode, SwayModel
from tests.cli.invocation import invoke
from tests.rigs.files import machine_file

TICK_S, G, LAG_S = 0.02, 9.81, 0.1
VALVE = {"tick_s": TICK_S, "rate_per_s": 5.0}
Vector = NDArray[np.float64]


@dataclass(frozen=True)
class DoublePendulum:
    """Rotator of 60 kg at ``upper_m`` below the tip, below it grapple and logs with an inertia."""

    upper_m: float
    joint_nms: float = 25.0
    upper_kg: float = 60.0
    lower_kg: float = 700.0
    lower_m: float = 0.9
    inertia_kg_m2: float = 200.0

    def mass(self, angle: float) -> Vector:
        """Mass matrix at an angle between both links."""
        coupling = self.lower_kg * self.upper_m * self.lower_m * math.cos(angle)
        upper = (self.upper_kg + self.lower_kg) * self.upper_m**2
        lower = self.lower_kg * self.lower_m**2 + self.inertia_kg_m2
        return np.array([[upper, coupling], [coupling, lower]])

    def rates(self, state: Vector, tip_m_s2: float) -> Vector:
        """Rates of (upper angle, lower angle, their rates), rad from the vertical."""
        one, two, rate1, rate2 = state
        moments = np.array(
            [(self.upper_kg + self.lower_kg) * self.upper_m, self.lower_kg * self.lower_m]
        )
        pull = moments * (G * np.sin([one, two]) + tip_m_s2 * np.cos([one, two]))
        whirl = self.lower_kg * self.upper_m * self.lower_m * math.sin(one - two)
        joint = self.joint_nms * (rate2 - rate1)
        torque = np.array(
            [joint - self.joint_nms * rate1 - whirl * rate2**2, whirl * rate1**2 - joint]
        )
        acceleration = np.linalg.solve(self.mass(one - two), torque - pull)
        return np.array([rate1, rate2, *acceleration])

    def eigen(self) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Poles and shapes about rest, by differences of ``rates``; the slower mode first."""
        step = 1e-6
        columns = [self.rates(step * one, 0.0) / step for one in np.eye(4)]
        poles, shapes = np.linalg.eig(np.array(columns).T)
        order = [i for i in np.argsort(np.abs(poles)) if poles[i].imag > 0.0]
        return poles, np.hstack([shapes[:, order], shapes[:, order].conj()])

    def modes(self) -> list[SwayMode]:
        """Both modes about rest."""
        poles = sorted((p for p in self.eigen()[0] if p.imag > 0.0), key=abs)
        return [SwayMode(float(abs(p)), max(0.0, float(-p.real / abs(p)))) for p in poles]

    def left_deg(self, state: Vector) -> tuple[float, float]:
        """Swing of the lower link in each mode."""
        shapes = self.eigen()[1]
        parts = np.linalg.solve(shapes, state.astype(complex))
        first, second = (math.degrees(2.0 * abs(parts[i] * shapes[1, i])) for i in (0, 1))
        return first, second

    def after(self, sent: list[float]) -> Vector:
        """State after a tip at 1 m/s full speed was sent these velocities, through a valve."""

        def rates(t: float, x: Vector) -> Vector:
            commanded = sent[min(int(t / TICK_S + 1e-9), len(sent) - 1)]
            tip = (commanded - x[4]) / LAG_S
            return np.array([*self.rates(x[:4], tip), tip])

        end_s = len(sent) * TICK_S
        solution = solve_ivp(rates, (0.0, end_s), np.zeros(5), max_step=0.01, rtol=1e-7, atol=1e-9)
        state: Vector = solution.y[:4, -1]
        return state


LOGS = DoublePendulum(0.4)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """The forwarder with the first mode of the logs on its near-far axis."""
    first = LOGS.modes()[0]
    swing = f"period_s: {first.period_s:.4f}, damping_ratio: {first.damping_ratio:.4f}"
    return machine_file(
        tmp_path, "forwarder", ("length_m: 1.2, damping_nms: 120, mass_kg: 300", swing)
    )


def option(range_pct: float = 20.0) -> str:
    second = LOGS.modes()[1]
    return f"{second.period_s:.4f},{second.damping_ratio:.4f},{range_pct:g}"


def robust(file: Path, *words: str) -> tuple[int, str]:
    done = invoke("robust", file, "--axis", "near_far", *words)
    return done.exit_code, " ".join(done.output.split())


def designed(file: Path, *words: str) -> BoundAxis:
    status, output = robust(file, *words, "--duration", "1.8", "--write")
    assert status == 0, output
    return load_deployment(file).axes["near_far"]


def pulse(bound: BoundAxis, hold_s: float) -> list[float]:
    """Setpoints of an axis for a full press, until a moment after its filter is over."""
    assert bound.config.sway is not None
    sway, machine = SwayModel(bound.config.sway.mode(), TICK_S), Machine.of(bound)
    shaper = build_shaper(
        "robust", TICK_S, sway, valve_rate_per_s=5.0, **bound.config.filter.parameters()
    )
    axis = ShapedAxis(
        TICK_S, machine.limits, sway=sway, shaper=shaper, neutral_band=0.02, stop_s=2.0
    )
    axis.tick(CommandInput(0.0))
    sent = []
    for tick in range(round((hold_s + 2.0) / TICK_S)):
        axis.tick(CommandInput(1.0 if tick * TICK_S < hold_s else 0.0))
        sent.append(axis.output.setpoint)
    return sent


def test_the_pendulum_keeps_its_energy_and_swings_with_its_modes() -> None:
    free = DoublePendulum(0.4, joint_nms=0.0)

    def energy(state: Vector) -> float:
        rates = state[2:]
        height = (free.upper_kg + free.lower_kg) * free.upper_m * (1.0 - math.cos(state[0]))
        height += free.lower_kg * free.lower_m * (1.0 - math.cos(state[1]))
        return float(0.5 * rates @ free.mass(state[0] - state[1]) @ rates) + G * height

    start = np.array([0.6, -0.4, 0.3, 1.0])
    path = solve_ivp(lambda _t, x: free.rates(x, 0.0), (0.0, 5.0), start, rtol=1e-9, atol=1e-11)
    assert [energy(x) for x in path.y.T] == pytest.approx([energy(start)] * len(path.t), rel=1e-6)
    for i, mode in enumerate(free.modes()):
        small = 1e-4 * free.eigen()[1][:, i].real
        end = solve_ivp(
            lambda _t, x: free.rates(x, 0.0), (0.0, mode.period_s), small, rtol=1e-9, atol=1e-13
        ).y[:, -1]
        assert end == pytest.approx(small, abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("upper_m", [0.3, 0.4, 0.5])
def test_the_second_mode_is_left_in_peace_within_its_range_at_no_run_on(
    file: Path, upper_m: float
) -> None:
    """0.3 and 0.5 m are the ends of +-20 % of the second mode."""
    pendulum = DoublePendulum(upper_m)
    share = (pendulum.modes()[1].period_s / LOGS.modes()[1].period_s) ** 2
    assert share == pytest.approx({0.3: 0.8, 0.4: 1.0, 0.5: 1.2}[upper_m], abs=0.02)
    without, covering = designed(file), designed(file, "--second", option())
    for hold_s in (1.0, 3.0):
        before, after = pulse(without, hold_s), pulse(covering, hold_s)
        assert np.flatnonzero(after)[-1] <= np.flatnonzero(before)[-1]
        assert sum(after) == pytest.approx(sum(before), rel=0.01)
        (first_before, second_before), (first, second) = (
            pendulum.left_deg(pendulum.after(sent)) for sent in (before, after)
        )
        assert second_before > 0.45
        assert second < 0.3
        assert second < 0.3 * second_before
        assert first < first_before + 0.15


@pytest.mark.slow
def test_no_allowed_second_mode_spoils_the_first() -> None:
    """Compared with a swing that has died away, a damped one took the first from 0.1 to 6.8."""
    first = SwayMode.from_period(2.4, 0.02)
    options = {"duration_s": 1.84, "range_pct": 15.0, **VALVE}
    alone = least_residual(first, **options)
    for period_s in (0.3, 0.6, 0.96):
        for damping_ratio in (0.0, 0.1, 0.4):
            second = second_mode(first, period_s, damping_ratio, 20.0, **VALVE)
            covering = least_residual(first, second=second, **options)
            assert covering.residual < alone.residual + 0.02
            assert covering.second_residual <= 0.51 * covering.residual
            assert covering.mean_delay_s < alone.mean_delay_s + 0.01
    for period_s in (1.2, 1.92):  # of hook and load
        second = second_mode(first, period_s, 0.0, 20.0, **VALVE)
        longer = least_residual(first, second=second, **options | {"duration_s": 2.45})
        assert longer.residual < alone.residual


@pytest.mark.slow
def test_the_shortest_keeps_both_modes_below_the_residual() -> None:
    first = LOGS.modes()[0]
    second = second_mode(first, 0.645, 0.09, 20.0, **VALVE)
    covering = shortest(first, residual_pct=5.0, range_pct=15.0, second=second, **VALVE)
    alone = shortest(first, residual_pct=5.0, range_pct=15.0, **VALVE)
    assert max(covering.residual, covering.second_residual) <= 0.05
    assert alone.duration_s <= covering.duration_s < alone.duration_s + 0.2


@pytest.mark.slow
def test_it_prints_what_the_second_mode_costs_and_gains(file: Path) -> None:
    status, output = robust(file, "--second", option(), "--duration", "1.8")
    assert status == 0
    assert "run-on, s mean delay, s first mode, % second mode, %" in output
    assert "without --second 1.80 0.89 8.6 23.3" in output
    assert "with it 1.80 0.84 9.6 4.8" in output


@pytest.mark.slow
def test_the_file_records_it(file: Path) -> None:
    bound = designed(file, "--second", option(25.0))
    design = bound.config.filter.design()
    assert design is not None
    second = LOGS.modes()[1]
    assert design.second == SecondMode(
        period_s=round(second.period_s, 4),
        damping_ratio=round(second.damping_ratio, 4),
        length_range_pct=25.0,
    )
    checked = invoke("check", file).output
    assert checked.count("hydraulics: missing") == checked.count("reversal_s: 2") == 1
    assert checked.count("WARNING") == 2
    file.write_text(file.read_text().replace("length_range_pct: 25.0", "length_range_pct: 61.0"))
    checked = invoke("check", file)
    assert checked.exit_code == 2
    where = "axes.near_far.filter.designed_for.second.length_range_pct"
    assert f"{where}: expected 0 to 60 %, got 61.0" in " ".join(checked.output.split())


@pytest.mark.slow
def test_another_period_stretches_the_taps_as_long_as_the_second_mode_is_covered(
    file: Path,
) -> None:
    """Of the second mode 20 % of its length is covered: some 10 % of the period."""
    config = designed(file, "--second", option()).config
    assert config.sway is not None
    assert config.sway.period_s is not None
    key = AxisKey("near_far", "sway", "period_s")
    longer = adjusted(config, {key: 1.08 * config.sway.period_s}, config)
    assert len(longer.filter.parameters()["taps"]) > len(config.filter.parameters()["taps"])
    for factor in (0.85, 1.15):
        with pytest.raises(
            ValueError, match=r"designed_for\.second\.period_s: expected .*got 0.64"
        ):
            adjusted(config, {key: factor * config.sway.period_s}, config)
    assert designed(file).config.filter.design() == config.filter.design()  # it is kept
    single = designed(file, "--second", "none").config
    assert adjusted(single, {key: 1.15 * config.sway.period_s}, single) != single


@pytest.mark.parametrize(
    ("second", "says"),
    [
        ("0.6,0.1", "expected PERIOD,DAMPING,RANGE, such as 0.6,0.1,20, or none, got '0.6,0.1'"),
        ("quick", "expected PERIOD,DAMPING,RANGE, such as 0.6,0.1,20, or none, got 'quick'"),
        ("0.1,0.1,20", "expected a period of 0.3 to 1.98 s, got 0.1 s"),
        ("nan,0.1,20", "expected a period of 0.3 to 1.98 s, got nan s"),
        ("2.2,0.1,20", "expected a period of 0.3 to 1.98 s, got 2.2 s"),
        ("0.6,0.7,20", "expected a damping ratio of 0 to 0.4, got 0.7"),
        ("0.6,-0.1,20", "expected a damping ratio of 0 to 0.4, got -0.1"),
        ("0.6,0.1,80", "expected a range of length of 0 to 60 %, got 80 %"),
    ],
)
def test_what_cannot_be_is_refused_and_the_file_is_as_it_was(
    file: Path, second: str, says: str
) -> None:
    before = file.read_bytes()
    assert robust(file, f"--second={second}", "--write") == (2, f"--second: {says}")
    assert file.read_bytes() == before


def test_a_slow_valve_makes_no_second_mode_swing(file: Path) -> None:
    file.write_text(file.read_text().replace("rise_per_s: 5", "rise_per_s: 0.7"))
    output = robust(file, "--second", "0.6,0.1,20")[1]
    assert output == "--second: expected none with a valve of 0.7 /s, got 0.6 s"
