"""How many drives a second the closed loop makes in lock-step, and what takes the time.

The demo script with a shipped deployment, in turn: recorded from its frames, as `demo` and
`compare` drive it; measured on the fly, as a campaign does; and the plant alone with the same
commands. The ratio to the plant alone hardly depends on the machine.

    python benchmarks/lockstep.py [--runs 5] [--deployment forwarder-robust.yaml]
"""

import argparse

from measure import Figure, medians_s, publish

from canshaper.design.lockstep import Simulation, drive
from canshaper.machine.binding import load_deployment
from canshaper.shipped import deployment_path
from canshaper_sim.crane import Crane
from canshaper_sim.operator import SCRIPTS

FIGURES = (Figure("a drive of a campaign, ms", "its crane alone"),)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--deployment", default="forwarder-robust.yaml")
    options = parser.parse_args()
    deployment = load_deployment(deployment_path(options.deployment))
    script = SCRIPTS["demo"]
    recording = drive(deployment, script)
    sent = {name: trace.sent for name, trace in recording.axes.items()}
    tick_s = deployment.config.tick_ms / 1000.0

    def alone() -> None:
        crane = Crane()
        for i in range(len(recording.t_s)):
            crane.step(tick_s, {name: values[i] for name, values in sent.items()})

    def lean() -> None:
        for _ in Simulation(deployment, script).ticks():
            pass

    works = {"recorded": lambda: drive(deployment, script), "lean": lean, "plant alone": alone}
    times = medians_s(works, options.runs)
    plant_s = times["plant alone"]
    for name, median_s in times.items():
        print(
            f"{name:12} {1 / median_s:6.1f} drives a second of CPU,"
            f" {script.duration_s / median_s:6.0f} x real time, {median_s / plant_s:5.2f} x plant"
        )
    publish(FIGURES, [(1e3 * times["lean"], 1e3 * plant_s)])


if __name__ == "__main__":
    main()
