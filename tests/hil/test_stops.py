"""Stops of the process and silence of a joystick, timed by the kernel: see ``stops.py``.

What is judged is the gap between two frames, which a slow or busy host cannot hide; how soon a
command falls is measured in a machine with a steady clock only, and stands in docs/safety.md.
"""

from pathlib import Path

from tests.hil.figures import wrong_stops
from tests.hil.stops import STEPS_MS, bench


def test_a_stop_longer_than_the_age_limit_trips_and_one_within_it_does_not(tmp_path: Path) -> None:
    with bench(tmp_path) as running:
        stops = [running.stop(stop_ms) for stop_ms in STEPS_MS]
    assert wrong_stops(stops) == []
    assert any(stop.stalled for stop in stops)
