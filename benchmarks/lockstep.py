"""How much faster than real time the closed loop runs in lock-step, and what takes the time.

One drive of the demo script with the shipped deployment: operator, the daemon's controller and the
plant exchange every frame. Beside it the plant alone, with the same commands.

    python benchmarks/lockstep.py [--runs 5]
"""

import argparse
import statistics
import time

from canshaper.design.lockstep import drive
from canshaper.machine.binding import load_deployment
from canshaper.shipped import deployment_path
from canshaper_sim.crane import Crane
from canshaper_sim.operator import SCRIPTS


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=5)
    runs = parser.parse_args().runs
    deployment = load_deployment(deployment_path("forwarder.yaml"))
    script = SCRIPTS["demo"]
    loop, plant = [], []
    for _ in range(runs):
        start = time.perf_counter()
        recording = drive(deployment, script)
        loop.append(script.duration_s / (time.perf_counter() - start))
        crane = Crane()
        sent = {name: trace.sent for name, trace in recording.axes.items()}
        start = time.perf_counter()
        for i in range(len(recording.t_s)):
            crane.step(0.02, {name: values[i] for name, values in sent.items()})
        plant.append(script.duration_s / (time.perf_counter() - start))
    for title, row in (("closed loop", loop), ("plant alone", plant)):
        print(f"{title:12} median {statistics.median(row):6.0f} x real time, least {min(row):6.0f}")


if __name__ == "__main__":
    main()
