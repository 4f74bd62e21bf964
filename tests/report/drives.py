"""Drives for the report's tests: built by hand, and driven through a small linear crane."""

import math
import random
from collections.abc import Callable

from canshaper_sim.recording import AxisTrace, Recording

DT_S = 0.02
Signal = Callable[[float], float]


def zero(_t: float) -> float:
    return 0.0


def held(*strokes: tuple[float, float, float]) -> Signal:
    """A joystick that is held at a level from press to release: (press, release, level)."""
    return lambda t: next((v for on, off, v in strokes if on - 1e-9 <= t < off - 1e-9), 0.0)


def sampled(
    duration_s: float,
    *,
    dt_s: float = DT_S,
    drop: frozenset[int] = frozenset(),
    **axes: tuple[Signal, Signal, Signal, Signal | None],
) -> Recording:
    """Sample (joystick, sent, speed, sway) functions of time; ``drop`` are lost samples."""
    t_s = [k * dt_s for k in range(round(duration_s / dt_s) + 1) if k not in drop]
    return Recording(
        t_s=t_s,
        axes={
            name: AxisTrace(
                *([signal(t) for t in t_s] for signal in signals[:3]),
                None if signals[3] is None else [signals[3](t) for t in t_s],
            )
            for name, signals in axes.items()
        },
    )


# (press, release, level) of each joystick: single strokes with rests, then both at once.
SCRIPT = {
    "near_far": [(1.0, 4.0, 1.0), (10.0, 13.0, -1.0), (28.0, 31.0, 0.6)],
    "slew": [(19.0, 22.0, 1.0), (28.6, 31.4, -0.7)],
    "lift": [(34.0, 35.0, 0.5)],
}
# frequency rad/s, damping, rad/s^2 of swing per acceleration of the tip, full speed
MODES = {"near_far": (2.859, 0.049, 0.8333, 1.0), "slew": (2.669, 0.038, 2.178, 0.5)}
VALVE_LAG_S, VALVE_RATE, STEP_S = 0.1, 5.0, 0.001


def joystick_at(axis: str, t: float) -> float:
    for press, release, level in SCRIPT[axis]:
        if press <= t < release:
            return level * min(1.0, (t - press) / 0.1 + 0.2)
    return 0.0


def drive(*, shaped: bool, seed: int, period_s: float = DT_S) -> Recording:
    """Drive the script through rate-limited, lagging valves and linear pendulums."""
    rng = random.Random(seed)
    grid = [k * period_s + rng.uniform(0.0, 0.002) for k in range(int(37.0 / period_s))]
    t_s = [t for t in grid if rng.random() > 0.01]
    traces = {axis: _simulate(axis, shaped, t_s) for axis in SCRIPT}
    # While slewing the grapple also swings parallel to the boom; a share stands for the coupling.
    near_far, slew = traces["near_far"].sway_deg, traces["slew"].sway_deg
    assert near_far is not None and slew is not None
    near_far[:] = [round(a + 0.5 * b, 2) for a, b in zip(near_far, slew, strict=True)]
    return Recording(t_s, traces)


def _simulate(axis: str, shaped: bool, t_s: list[float]) -> AxisTrace:
    omega, zeta, gain, full = MODES.get(axis, (2.859, 0.049, 0.0, 1.0))
    model = filtered = (0.0, 0.0)
    speed = sent = 0.0
    trace: tuple[list[float], ...] = ([], [], [], [])
    k = 0
    for step in range(round(t_s[-1] / STEP_S) + 2):
        t = step * STEP_S
        joystick = joystick_at(axis, t)
        if step % 20 == 0:
            expected = joystick
            if shaped and gain:
                # y = u + (2 z / w) f' - (2 / w) f' with f the double pole at w: D = 1
                y, rate = filtered
                for _ in range(20):
                    rate += STEP_S * (omega**2 * (joystick - y) - 2 * omega * rate)
                    y += STEP_S * rate
                filtered = (y, rate)
                bend = omega**2 * (joystick - y) - 2 * omega * rate
                expected = y + 2 * zeta / omega * rate + bend / omega**2
            move = max(-VALVE_RATE * 0.02, min(VALVE_RATE * 0.02, expected - sent))
            sent = round((sent + move) * 125) / 125
        before, speed = speed, speed + STEP_S * (sent - speed) / VALVE_LAG_S
        angle, rate = model
        push = gain * full * (speed - before) / STEP_S
        rate += STEP_S * (push - 2 * zeta * omega * rate - omega**2 * angle)
        model = (angle + STEP_S * rate, rate)
        if k < len(t_s) and t >= t_s[k]:
            values = (joystick, sent, speed, round(math.degrees(model[0]), 2))
            for column, value in zip(trace, values, strict=True):
                column.append(value)
            k += 1
    return AxisTrace(*trace[:3], trace[3] if gain else None)
