"""Drives of the simulated crane that several tests share."""

import math
from collections.abc import Sequence
from typing import Any

from canshaper_sim.crane import Crane, CraneParameters, CraneState
from canshaper_sim.valve import ValveParameters

TICK_S = 0.02
# The valves of the reference runs: first-order lag of 100 ms, without and with 5 full speeds/s.
LINEAR = ValveParameters(deadband=0.0, rate_limit_1_s=math.inf)
REAL = ValveParameters(deadband=0.0)


def all_valves(valve: ValveParameters, **changes: Any) -> CraneParameters:
    return CraneParameters(slew=valve, near_far=valve, lift=valve, **changes)


def drive(crane: Crane, axis: str, commands: Sequence[float], parts: int = 4) -> list[CraneState]:
    """Hold every command for a tick; the state is taken `parts` times in a tick."""
    states = [crane.state]
    for command in commands:
        for _ in range(parts):
            crane.step(TICK_S / parts, {axis: command})
            states.append(crane.state)
    return states


def mixed_commands(ticks: int) -> list[dict[str, float]]:
    """Steps on all three axes, none of them at the same time as another."""
    return [
        {
            "slew": (0.0, 0.8, 0.8, -0.6, 0.0)[k // 40 % 5],
            "near_far": (0.5, 0.5, -0.9, 0.0)[(k + 13) // 40 % 4],
            "lift": (0.0, -0.7, 0.9, 0.4)[(k + 27) // 40 % 4],
        }
        for k in range(ticks)
    ]
