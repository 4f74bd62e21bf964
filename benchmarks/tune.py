"""Time of the tuner: building the programme, solving it, and the whole command with its picture.

The peer solves the same problem, the sum of Eq. 15 written in numpy, with SciPy's Nelder-Mead from
one start: what an engineer would write first.

    python benchmarks/tune.py [--runs 5]
"""

import argparse
import math
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import minimize

from canshaper.design.tuning.formulation import Requirements, Task
from canshaper.design.tuning.optimal import Tuning, tune
from canshaper.shaping.sway import SwayMode

MODE = SwayMode.from_grapple(1.2, 120.0, 300.0)
TASKS = {
    "Eq. 14-15": Task(MODE, require=Requirements(within_command=False)),
    "output within the command": Task(MODE),
    "run-on of 1.9 s": Task(MODE, require=Requirements(max_run_on_s=1.9)),
    "third pole, valve of 5 /s": Task(
        MODE, require=Requirements(third_pole=True, max_rate_per_s=5.0)
    ),
    "worst of -15 ... +15 % length": Task(
        MODE, length_range_pct=15.0, require=Requirements(max_run_on_s=2.0)
    ),
    "tick of 5 ms": Task(MODE, tick_s=0.005),
}


def peer() -> float:
    """Cost of the first task, found with Nelder-Mead on a numpy rollout."""
    w = MODE.omega_rad_s

    def cost(z: NDArray[np.float64]) -> float:
        p, q = math.exp(z[0]), math.exp(z[0] + abs(z[1]))
        a1, a2 = 1.0 / p + 1.0 / q, 1.0 / (p * q)
        system = np.array([[0.0, 1.0, 0.0], [-1.0 / a2, -a1 / a2, 1.0 / a2], [0.0, 0.0, 0.0]])
        step, x, rows = expm(0.02 * system), np.array([0.0, 0.0, 1.0]), []
        for _ in range(150):
            rows.append(x)
            x = step @ x
        v, rate, _ = np.array(rows).T
        rate_2 = (1.0 - v - a1 * rate) / a2
        y = v + 2.0 * MODE.damping_ratio / w * rate + rate_2 / w**2
        swing = (rate / w) ** 2 + (rate_2 / w**2) ** 2
        follow = (y - 0.95) ** 2 + 3.0 * (y - 1.0) ** 2
        return float(np.mean(swing + follow + np.diff(y, prepend=0.0) ** 2))

    start = np.array([math.log(w), 0.2])
    return float(minimize(cost, start, method="Nelder-Mead", options={"xatol": 1e-5}).fun)


def timed(run: Callable[[], object], runs: int) -> float:
    """Median duration, s."""
    spent = []
    for _ in range(runs):
        begin = time.perf_counter()
        run()
        spent.append(time.perf_counter() - begin)
    return statistics.median(spent)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=5)
    runs = parser.parse_args().runs
    print(f"median of {runs} runs, s; three starts, ranges of the poles included in the solve")
    print(f"{'':34}{'build':>9}{'solve':>9}   a1, a2")
    for title, task in TASKS.items():
        tunings: list[Tuning] = [tune(task) for _ in range(runs)]
        build = statistics.median(t.build_s for t in tunings)
        solve = statistics.median(t.solve_s for t in tunings)
        print(f"{title:34}{build:9.3f}{solve:9.3f}   {tunings[0].a1:.4f}, {tunings[0].a2:.4f}")
    print(f"{'Nelder-Mead on numpy, one start':34}{'':9}{timed(peer, runs):9.3f}   (Eq. 14-15)")
    with tempfile.TemporaryDirectory() as directory:
        command = [sys.executable, "-m", "canshaper", "tune", "forwarder.yaml", "--out", directory]
        for options in (["--axis", "slew"], ["--axis", "slew", "--third-pole"]):

            def run(options: list[str] = options) -> None:
                subprocess.run([*command, *options], check=True, capture_output=True)

            title = f"canshaper tune {' '.join(options)}"
            print(f"{title:42}{timed(run, runs):10.3f}   start to picture")


if __name__ == "__main__":
    main()
