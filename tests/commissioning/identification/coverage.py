"""Whether intervals of 95 % hold the truth: simulated cranes of many tools, driven in many ways.

Some are driven in one direction, some in both with short pauses or long ones; noise as of a sensor.
A minute for some ten cranes:

    python -m tests.commissioning.identification.coverage [--cranes 150] [--seed 0]
"""

import argparse
import os
import random
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

from canshaper.commissioning.identification.canlog import read_can
from canshaper.commissioning.identification.verdict import SwingFinding, identify
from canshaper.machine.binding import load_deployment
from canshaper_sim.grapple import Grapple, SwayMode
from tests.commissioning.identification.machine import FILE, Push, candump, driven, period_of

SIGNALS = {"slew": "GrappleSway.SwayPerpendicular", "near_far": "GrappleSway.SwayParallel"}
SECONDS = 90.0
ONE, BOTH, CALM = "one direction", "both", "both, long pauses"
PAUSES_S = {ONE: (0.3, 6.0), BOTH: (0.3, 6.0), CALM: (15.0, 30.0)}


class Case(NamedTuple):
    """Values identified of an axis, and the truth."""

    driving: str
    mode: SwayMode
    finding: SwingFinding


def drawn(seed: int) -> list[Case]:
    """Draw a tool and a way of driving it, and identify every axis that was driven."""
    chance = random.Random(seed)
    damping = chance.choice([chance.uniform(60.0, 400.0), chance.uniform(120.0, 250.0)])
    tool = Grapple(
        l2_m=chance.uniform(0.8, 2.4),
        m2_kg=chance.uniform(250.0, 1200.0),
        c5_n_m_s_rad=damping * chance.uniform(0.7, 1.4),
        c6_n_m_s_rad=damping * chance.uniform(0.7, 1.4),
    )
    driving = chance.choice(list(PAUSES_S))
    level, noise_deg = chance.uniform(0.1, 0.4), chance.uniform(0.05, 0.3)
    return cases(tool, driving, level, noise_deg, seed)


def cases(tool: Grapple, driving: str, level: float, noise_deg: float, seed: int) -> list[Case]:
    """Drive a tool at about a level of full speed, and identify every axis that was driven."""
    chance, pushes = random.Random(seed), []
    axes = ["near_far"] if driving == ONE else list(SIGNALS)
    for axis in axes:
        at = 2.0 + chance.uniform(0, 3)
        while at < SECONDS - 5.0:
            long, part = chance.uniform(0.4, 2.0), level * chance.uniform(0.6, 1.2)
            pushes.append(Push(axis, at, long, chance.choice([-1, 1]) * part))
            at += long + chance.uniform(*PAUSES_S[driving])
    deployment = load_deployment(FILE)
    with tempfile.TemporaryDirectory() as folder:
        states = driven(SECONDS, pushes, grapple=tool)
        log = candump(Path(folder) / "drive.log", states, seed=seed, noise_deg=noise_deg)
        read = read_can(log, SIGNALS, deployment.messages, deployment=deployment)
    modes = {"slew": tool.mode5, "near_far": tool.mode6}
    return [Case(driving, modes[axis], identify(axis, "", [read[axis]])) for axis in axes]


def held(case: Case) -> tuple[bool, bool]:
    """Whether the intervals of period and damping ratio hold the truth."""
    period, ratio = case.finding.period_s, case.finding.damping_ratio
    assert period and ratio
    return (
        abs(period.value - period_of(case.mode)) <= period.half,
        abs(ratio.value - case.mode.zeta) <= ratio.half,
    )


def main() -> None:
    """Print a line for every way of driving."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--cranes", type=int, default=150)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    every = [case for i in range(options.cranes) for case in drawn(options.seed + i)]
    groups: dict[str, list[Case]] = defaultdict(list)
    for case in every:
        if case.finding.usable:
            alone = "free swings" if case.finding.free else "driven alone"
            for name in ("all", f"{case.driving}, {alone}"):
                groups[name].append(case)
    print(f"{len(every)} axes, {len(groups['all'])} of them usable; the intervals hold")
    for name, some in sorted(groups.items()):
        periods, ratios = zip(*map(held, some), strict=True)
        halves = sorted(
            case.finding.damping_ratio.half for case in some if case.finding.damping_ratio
        )
        print(
            f"  {name} ({len(some)}): period {100 * sum(periods) / len(some):.0f} %, damping ratio"
            f" {100 * sum(ratios) / len(some):.0f} %, which is within {halves[len(some) // 2]:.4f}"
        )


if __name__ == "__main__":
    main()
