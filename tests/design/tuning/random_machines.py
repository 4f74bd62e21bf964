"""Random machines: is the verdict of ``check`` what a drive shows?

    python -m tests.design.tuning.random_machines [COUNT] [FIRST]

The judge shares no model with the verdict: joystick frames go into the controller, its valve
frames through a valve with lag to a tip on a track without end, and the pendulum is the nonlinear
one, with a damped joint, solved by scipy. A press begins at rest, a release in full motion at rest.
"""

import math
import random
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from canshaper.codec.frame import Frame
from canshaper.commissioning.robust import design_robust
from canshaper.controller.controller import Controller
from canshaper.design.tuning import verdict as verdict_module
from canshaper.design.tuning.verdict import Verdict, verdicts
from canshaper.edit.edit import flow
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.rigs.files import ROOT

COUNT = 200
G_M_S2 = 9.81
MASS_KG = 300.0
DEADBAND = 0.05
# Agreement: good leaves at most 15 % in the drive, poor 2/3 of its least to 3/2 of its most.
MOST = {"good": 0.15, "poor": 0.75, "useless": math.inf}
LEAST = {"good": 0.0, "poor": 0.067, "useless": 0.33}
# A raw swing below this part of its largest one is over: the tool hangs still by itself.
STILL = 0.02
# Tip amplitude of the raw swing: the pendulum is nonlinear, and does not turn over.
LARGEST_RAD = 0.5
FILE = """\
version: 1
tick_ms: {tick_ms}
buses:
  crane: {{ interface: socketcan, channel: vcan0, bitrate: 1000000 }}
dbc: [machine.dbc]
joysticks:
  left:
    {{ bus: crane, message: JoystickLeft, timeout_ms: 200, stuck_s: 3600, enable: Enable,
      reset: Reset, anti_sway_off: AntiSwayOff, alive_counter: AliveCounter }}
axes:
  near_far:
    command: {{ joystick: left, signal: NearFar, neutral_pct: 2 }}
    valve: {{ bus: crane, message: NearFarCommand, signal: Velocity, timeout_ms: 500,
      alive_counter: AliveCounter }}
    sway: {{ length_m: {length_m}, damping_nms: {damping_nms}, mass_kg: 300,
      full_speed_m_s: {speed_m_s} }}
    filter: {filter}
    limits: {{ deadband_pct: 5, rise_per_s: {rise}, fall_per_s: {fall}, tail_s: {tail_s},
      stop_s: 5, stop_distance_m: 200 }}
"""


@dataclass(frozen=True)
class Drawn:
    """A machine; ``what`` says where its filter comes from, "" for a robust one by the tool."""

    length_m: float
    damping_ratio: float
    rate_per_s: float
    lag_s: float
    tail_s: float
    tick_ms: int
    speed_m_s: float
    filter: str
    what: str

    @property
    def omega(self) -> float:
        """rad/s."""
        return math.sqrt(G_M_S2 / self.length_m)

    def written(self, folder: Path) -> Deployment:
        """The machine as a deployment."""
        network = (ROOT / "dbc" / "forwarder.dbc").read_text("cp1252")
        for number in (272, 513):
            old = f'"GenMsgCycleTime" BO_ {number} 20;'
            assert old in network
            network = network.replace(old, old.replace(" 20;", f" {self.tick_ms};"))
        (folder / "machine.dbc").write_text(network, "cp1252")
        damping = 2.0 * self.damping_ratio * self.omega * MASS_KG * self.length_m**2
        values = {
            "tick_ms": self.tick_ms,
            "length_m": self.length_m,
            "damping_nms": round(damping, 3),
            "speed_m_s": self.speed_m_s,
            "filter": self.filter,
            "rise": self.rate_per_s,
            "fall": max(1.0, self.rate_per_s),  # the least of a file
            "tail_s": self.tail_s,
        }
        path = folder / "machine.yaml"
        path.write_text(FILE.format(**values), "utf-8")
        deployment = load_deployment(path)
        if not self.what:
            # The default, but for a valve that takes longer to full speed; then so long.
            own_s = 0.77 * deployment.axes["near_far"].config.sway.mode().period_s  # type: ignore[union-attr]
            least_s = None if own_s * self.rate_per_s > 1.1 else round(1.2 / self.rate_per_s, 2)
            section = flow(design_robust(deployment, "near_far", duration_s=least_s).section)
            path.write_text(FILE.format(**values | {"filter": section}), "utf-8")
            deployment = load_deployment(path)
        return deployment


def drawn(seed: int) -> Drawn:
    """The machine of a seed."""
    draw = random.Random(seed)

    def log(low: float, high: float) -> float:
        return low * (high / low) ** draw.random()

    length_m, damping = round(log(0.3, 20.0), 3), round(draw.choice((0.12, 0.9)) * draw.random(), 3)
    rate, lag_s = round(log(0.3, 10.0), 2), round(draw.uniform(0.0, 0.5), 3)
    tail_s, tick_ms = round(draw.uniform(0.5, 5.0), 1), max(1, round(log(1.0, 50.0)))
    omega = math.sqrt(G_M_S2 / length_m)
    speed = round(min(draw.uniform(0.5, 2.0), LARGEST_RAD * G_M_S2 / omega), 2)
    pole, third = omega * log(0.5, 2.0), omega * log(1.0, 3.0)
    filters = {
        "shipped": "{ kind: gff, a1: 0.708, a2: 0.12 }",
        "double pole": f"{{ kind: gff, poles_rad_s: [{-omega:.4f}, {-omega:.4f}] }}",
        "any poles": f"{{ kind: gff, poles_rad_s: [{-pole:.4f}, {-1.5 * pole:.4f}] }}",
        "three poles": f"{{ kind: gff, poles_rad_s: [{-pole:.4f}, {-pole:.4f}],"
        f" third_pole_rad_s: {-third:.4f} }}",
        "ZV": "{ kind: zv }",
        "ZVD": "{ kind: zvd }",
        "EI": "{ kind: ei, residual_pct: 5 }",
        "first order": f"{{ kind: first_order, time_constant_s: {min(5.0, 2.0 / omega):.3f} }}",
        "": "{ kind: zv }",
    }
    names = [*filters, "", ""]
    what = draw.choice(names)
    if not what and (damping > 0.3 or 0.85 * 2.0 * math.pi / omega / tick_ms * 1e3 > 950):
        what = "double pole"  # no robust one, or one of more taps than a file may have
    return Drawn(length_m, damping, rate, lag_s, tail_s, tick_ms, speed, filters[what], what)


Move = NDArray[np.float64]


def moves(deployment: Deployment, tick_ms: int, still_s: float, *, raw: bool) -> tuple[Move, Move]:
    """Speeds that the valve frames mean, part of full speed: of a long press, of the release.

    Each ends when it has stood still for so long, longer than any plateau of a filter.
    """
    controller = Controller(deployment)
    found = {name: deployment.messages.find(name)[1] for name in ("JoystickLeft", "NearFarCommand")}  # type: ignore[index]
    stick, valve = found["JoystickLeft"], found["NearFarCommand"]
    now_ns, count, result = 0, 0, []
    every = max(1, 20 // tick_ms)

    def tick(deflection: int, send: bool) -> float:
        nonlocal now_ns, count
        if send:
            count = (count + 1) % 256
            values = dict.fromkeys((s.name for s in stick.signals), 0)
            values |= {"NearFar": deflection, "Enable": 1, "AliveCounter": count}
            values["AntiSwayOff"] = int(raw)
            data = stick.encode(values, scaling=False, strict=False)
            controller.receive(Frame("crane", stick.frame_id, False, data), now_ns)
        sent = [f for f in controller.tick(now_ns, 0) if f.can_id == valve.frame_id]
        now_ns += tick_ms * 1_000_000
        data = sent[0].data
        opening = valve.decode(data, decode_choices=False)["Velocity"] / 100.0
        return math.copysign(max(0.0, (abs(opening) - DEADBAND) / (1.0 - DEADBAND)), opening)

    for k in range(10 * every):
        tick(0, k % every == 0)
    for deflection in (1000, 0):
        speeds: list[float] = []
        ticks = round(still_s * 1e3 / tick_ms)
        while len(speeds) <= ticks or speeds[-1] != speeds[-ticks]:
            speeds.append(tick(deflection, len(speeds) % every == 0))
        result.append(np.array(speeds))
    return result[0], result[1]


def swing_left(
    one: Drawn, move: Move, before: float, factor: float, until: int
) -> tuple[float, float]:
    """Amplitude of the swing at a tick after a move, and the largest swing until then, rad.

    x is the way of the tip, ml^2 theta'' + c theta' + m g l sin(theta) = -m l x'' cos(theta).
    """
    length_m, tick_s = one.length_m * factor, one.tick_ms / 1e3
    damping = 2.0 * one.damping_ratio * one.omega / factor**2  # c / (m l^2)
    lag_s = max(one.lag_s, 1e-3)

    def slope(t: float, s: NDArray[np.float64]) -> list[float]:
        held = move[min(int(t / tick_s + 1e-9), len(move) - 1)]
        acceleration = one.speed_m_s * (held - s[2]) / lag_s
        pull = G_M_S2 * math.sin(s[0]) + acceleration * math.cos(s[0])
        return [s[1], -damping * s[1] - pull / length_m, (held - s[2]) / lag_s]

    exact = {"method": "LSODA", "rtol": 1e-8, "atol": 1e-12, "max_step": tick_s}
    solved = solve_ivp(slope, (0.0, until * tick_s), [0.0, 0.0, before], **exact)
    state, peak = solved.y[:, -1], float(abs(solved.y[0]).max())
    omega = math.sqrt(G_M_S2 / length_m)
    real = 0.5 * damping
    damped = math.sqrt(omega**2 - real**2)
    return math.hypot(state[0], (state[1] + real * state[0]) / damped), peak


@dataclass(frozen=True)
class Judged:
    """Word of the verdict, and swing left in the drive."""

    seed: int
    machine: Drawn
    verdict: Verdict
    left: float

    @property
    def agrees(self) -> bool:
        """Whether the drive shows what the word says."""
        return LEAST[self.verdict.word] <= self.left <= MOST[self.verdict.word]

    def __str__(self) -> str:
        m = self.machine
        return (
            f"{self.seed:4} {'' if self.agrees else 'NOT'} {self.verdict.word:8}"
            f" {100 * self.verdict.left:6.1f} {100 * self.left:6.1f}  {m.length_m} m, damping"
            f" {m.damping_ratio}, {m.rate_per_s}/s, lag {m.lag_s}, tail {m.tail_s}, {m.tick_ms} ms,"
            f" {m.speed_m_s} m/s, {m.what or 'robust'}"
        )


def judged(seed: int) -> Judged:
    """Let ``check`` judge a machine, and drive it."""
    one = drawn(seed)
    with TemporaryDirectory() as folder:
        deployment = one.written(Path(folder))
        with pytest.MonkeyPatch.context() as patched:  # the word alone: no search for a cure
            patched.setattr(verdict_module, "_FASTER", ())
            patched.setattr(verdict_module, "longest_tail_s", lambda _mode: 0.0)
            ((_, verdict),) = verdicts(deployment)
        range_pct = 0.0
        if design := deployment.axes["near_far"].config.filter.design():
            range_pct = design.length_range_pct or 0.0
        still_s = 1.0 + 4.0 * math.pi / one.omega
        shaped = moves(deployment, one.tick_ms, still_s, raw=False)
        raw = moves(deployment, one.tick_ms, 1.0, raw=True)
    left = 1.0 if shaped[0][-1] < 0.5 else 0.0  # it does not move
    for factor in {1.0, 1.0 - range_pct / 100.0, 1.0 + range_pct / 100.0}:
        for k in (0, 1):
            pair = [shaped[k], raw[k]]
            ends = [max([0, *np.flatnonzero(np.diff(move))]) for move in pair]
            until = max(ends) + 1 + round(6.0 * one.lag_s * 1e3 / one.tick_ms)
            (mine, _), (other, peak) = (
                swing_left(one, move, start, factor, until)
                for move, start in zip(pair, (k * shaped[0][-1], k * raw[0][-1]), strict=True)
            )
            left = max(left, mine / max(other, STILL * peak))
    return Judged(seed, one, verdict, left)


def main() -> None:
    """Print all of them, and how many agree."""
    count, first = (*map(int, sys.argv[1:]), *(COUNT, 0)[len(sys.argv) - 1 :])
    results = []
    for seed in range(first, first + count):
        results.append(judged(seed))
        print(results[-1], flush=True)
    agree = sum(one.agrees for one in results)
    good = [one.left for one in results if one.verdict.word == "good"]
    print(f"{agree} of {count} agree; of {len(good)} good ones the worst leaves {max(good):.3f}")


if __name__ == "__main__":
    main()
