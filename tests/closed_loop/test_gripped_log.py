"""A log in the grapple: its weight on the bus, late, lost, restless, and no signal at all.

``pytest -s tests/closed_loop/test_gripped_log.py`` prints the figures: swing left, mean and worst,
degrees of total tilt.
"""

from collections.abc import Callable

import pytest

from tests.cli.invocation import invoke
from tests.closed_loop.mujoco_twin import TwinCrane, figures
from tests.closed_loop.test_pump import left_deg, shipped
from tests.closed_loop.test_twin import OPERATORS, TIMINGS, judged

LOG_KG = 600.0  # 900 kg at 1.6 m
LOG = ("log.grip_s=0", "log.mass_kg=600", "log.below_m=0.6")
WRONG_SET, WORST_WRONG = 4.5, 7.5  # what the filters of an empty grapple leave of the log


def crane(load: str, says_kg: Callable[[float], float | None] | None = None) -> TwinCrane:
    if load == "empty":
        return TwinCrane(says_kg=says_kg)
    return TwinCrane(log=(LOG_KG, 0.0, 0.0), lower_m=0.4, says_kg=says_kg)


def late(seconds: float) -> Callable[[float], float]:
    """So long after the first joystick has moved."""
    return lambda time_s: LOG_KG if time_s >= 0.5 + seconds else 0.0


def silent(_time_s: float) -> None:
    return None


def lost(time_s: float) -> float | None:
    return LOG_KG if time_s < 3.0 else None


def dropped_for_a_second(time_s: float) -> float:
    return 0.0 if 2.0 < time_s < 3.0 else LOG_KG


def to_and_fro(time_s: float) -> float:
    return LOG_KG if round(10.0 * time_s) % 2 else 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("load", "says_kg", "timings", "operators"),
    [
        ("empty", None, (0.2, 0.5), (0.4, 0.9)),
        ("log", None, (0.2, 0.6), (0.6, 1.5)),
        ("log", late(0.5), (0.2, 0.6), (0.6, 1.5)),
        ("log", late(1.0), (0.2, 0.7), (0.8, 2.0)),
        ("empty", silent, (0.6, 1.1), (1.2, 3.0)),
        ("log", silent, (1.1, 1.7), (2.9, 5.0)),
        ("log", lost, (0.7, 2.0), (2.9, 6.2)),
        ("log", to_and_fro, (1.1, 1.7), (2.9, 5.0)),
    ],
    ids=[
        "empty",
        "log",
        "late",
        "a second late",
        "empty unknown",
        "log unknown",
        "lost",
        "to and fro",
    ],
)
def test_the_swing_that_is_left(
    load: str,
    says_kg: Callable[[float], float | None] | None,
    timings: tuple[float, float],
    operators: tuple[float, float],
) -> None:
    deployment, twin = shipped("forwarder-load"), crane(load, says_kg)
    judged("14 timings", figures(deployment, TIMINGS, twin), *timings)
    judged("20 operators", figures(deployment, OPERATORS, twin), *operators, 36.0)


@pytest.mark.slow
def test_a_signal_that_is_wrong_for_a_second_costs_no_more_than_the_wrong_filters() -> None:
    wrong = figures(shipped("forwarder-load"), TIMINGS, crane("log", lambda _: 0.0))
    judged("wrong set", wrong, WRONG_SET, WORST_WRONG)
    dropped = figures(shipped("forwarder-load"), TIMINGS, crane("log", dropped_for_a_second))
    judged("dropped for a second", dropped, WRONG_SET, WORST_WRONG)


@pytest.mark.slow
def test_the_simulated_crane_says_what_it_has_gripped() -> None:
    mean, worst = left_deg(shipped("forwarder-load"), TIMINGS, *LOG)
    assert mean <= 0.2
    assert worst <= 0.6
    assert left_deg(shipped("forwarder-robust"), TIMINGS, *LOG)[0] > 3.0


@pytest.mark.slow
def test_the_demo_takes_a_log() -> None:
    changes = [word for one in LOG for word in ("--set", one)]
    done = invoke("demo", "forwarder-load.yaml", "--lockstep", *changes)
    assert done.exit_code == 0, done.output
