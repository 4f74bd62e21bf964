"""Speed-up of a campaign by a second process, and its memory over the drives.

The same drives of a shipped deployment in turn by one process and by two. Efficiency by the clock
is the time of one over twice that of two: true where nothing else runs. By the processor it is
processor time of one over that of two, which other work on the machine changes little; it leaves
out what waits for the last drives. At the end the memory of one process, over all it has driven.

    python benchmarks/campaign.py [--pairs 5] [--drives 320] [--deployment forwarder-robust.yaml]
"""

import argparse
import os
import statistics
import tempfile
import time
from pathlib import Path

from canshaper.campaign.run import Source, run_campaign
from canshaper.campaign.store import Store
from canshaper.design.parallel import Processes
from canshaper.machine.binding import load_deployment
from canshaper.shipped import deployment_path


def rss_mb() -> float:
    """Memory of this process now."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def timed_s(source: Source, processes: int, seeds: range) -> tuple[float, float]:
    """Time by the clock, and of processors, of these drives."""
    with tempfile.TemporaryDirectory() as folder:
        before, start_s = os.times(), time.monotonic()
        store = Store(Path(folder), source.about)
        run_campaign(Processes(processes), source, seeds, store, lambda _drives: None)
        after, end_s = os.times(), time.monotonic()
    return end_s - start_s, sum(after[:4]) - sum(before[:4])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--drives", type=int, default=320)
    parser.add_argument("--deployment", default="forwarder-robust.yaml")
    options = parser.parse_args()
    deployment = load_deployment(deployment_path(options.deployment))
    source = Source.of(deployment, deployment.config.uncertainty)
    count = options.drives
    timed_s(source, 1, range(count))  # everything is loaded
    memory = [rss_mb()]
    by_clock, by_processor, drive_s = [], [], []
    for pair in range(1, options.pairs + 1):
        seeds = range(pair * count, (pair + 1) * count)
        one, two = (timed_s(source, processes, seeds) for processes in (1, 2))
        by_clock.append(one[0] / (2.0 * two[0]))
        by_processor.append(one[1] / two[1])
        drive_s.append(one[1] / count)
        memory.append(rss_mb())
    print(f"one process: {1.0 / statistics.median(drive_s):.1f} drives a second of a processor")
    for name, ratios in (("clock", by_clock), ("processor", by_processor)):
        worst = f"{min(ratios):.0%} to {max(ratios):.0%}"
        print(f"efficiency of two, by the {name:9} {statistics.median(ratios):.0%}, {worst}")
    every = ", ".join(f"{mb:.1f}" for mb in memory)
    print(f"memory after each {count} drives: {every} MB")


if __name__ == "__main__":
    main()
