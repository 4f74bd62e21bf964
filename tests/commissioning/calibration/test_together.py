"""The flow of a pump, and how its valve shares it, out of drives of two axes; in the file."""

import math
import random
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from canshaper.commissioning.calibration.pump import Moment, PumpFlow, measured, pump_lines
from canshaper.commissioning.calibration.ramp import TOGETHER_PER_S, Ramp
from canshaper.config.section import Origin
from canshaper.edit.edit import written_by
from canshaper.errors import CalibrationError
from canshaper.machine.binding import load_deployment
from tests.rigs.files import ROOT

AXES = ("slew", "near_far")
ONE = {"slew": 1.0, "near_far": 1.0}
SPEEDS = {"slew": ("TipVelocity", "SlewRate"), "near_far": ("TipVelocity", "RadialSpeed")}
TICK_S, LAG_S = 0.02, 0.1
FULL = (0.5, -1.2)  # speeds of the feedback, of which one counts the other way round
RESTS = (0.03, 0.0)  # what it shows at rest
Demands = list[tuple[float, float]]
Sharing = Callable[[Sequence[float], float], list[float]]


def alike(asked: Sequence[float], flow: float) -> list[float]:
    part = min(1.0, flow / max(sum(map(abs, asked)), 1e-9))
    return [part * one for one in asked]


def starving(asked: Sequence[float], flow: float) -> list[float]:
    """The second axis takes what it needs, the first one gets the rest."""
    last = math.copysign(min(abs(asked[1]), flow), asked[1])
    return [math.copysign(min(abs(asked[0]), flow - abs(last)), asked[0]), last]


def ramped(top: float = 1.0) -> Demands:
    """As calibrate drives: the first axis, the second, both."""
    ramp = Ramp(TOGETHER_PER_S, top)
    ticks = [ramp.command(TICK_S * k) for k in range(round(ramp.duration_s / TICK_S))]
    return [(v, 0.0) for v in ticks] + [(0.0, v) for v in ticks] + [(v, v) for v in ticks]


def driven(*strokes: tuple[float, float]) -> Demands:
    """As a driver does: each held for two seconds at once, and a second of rest."""
    return [demands for one in strokes for demands in [(0.0, 0.0)] * 50 + [one] * 100]


def drive(
    demands: Demands,
    flow: float,
    shares: Sharing = alike,
    *,
    noise: float = 0.0,
    most: float = 1.0,
    takes: tuple[float, float] = (1.0, 1.0),
    seed: int = 1,
) -> list[Moment]:
    """A drive of valves that give no more than ``most``, with the lag and the noise of speeds."""
    hand, speeds, moments = random.Random(seed), [0.0, 0.0], []
    for k, asked in enumerate(demands):
        flows = [t * max(-most, min(most, one)) for t, one in zip(takes, asked, strict=True)]
        got = [one / t for t, one in zip(takes, shares(flows, flow), strict=True)]
        moment = [TICK_S * k]
        for i in range(2):
            speeds[i] += TICK_S / LAG_S * (got[i] - speeds[i])
            shown = FULL[i] * (speeds[i] + hand.gauss(0.0, noise)) + RESTS[i]
            moment += [asked[i], shown]
        moments.append(moment)
    return moments


def directions_of(moments: list[Moment]) -> list[PumpFlow]:
    return measured([moments], AXES, ONE)


@pytest.mark.parametrize(
    ("shares", "kept"), [(alike, (0.6, 0.6)), (starving, (0.2, 1.0))], ids=["alike", "starving"]
)
def test_flow_and_sharing_are_found_in_both_directions(
    shares: Sharing, kept: tuple[float, float]
) -> None:
    directions = directions_of(drive(ramped(), 1.2, shares))
    assert {one.ways for one in directions} == {(1, 1), (-1, -1)}
    for one in directions:
        assert [part for part, _ in one.kept] == pytest.approx(kept, abs=0.01)
        assert one.flow == pytest.approx((1.2, 0.015), abs=0.01)
        assert one.asked == pytest.approx(2.0, abs=0.03)


def test_the_truth_lies_in_the_interval() -> None:
    hits = widths = 0.0
    for seed in range(12):
        for one in directions_of(drive(ramped(), 1.2, noise=0.1, seed=seed)):
            flow, half = one.flow
            hits += abs(flow - 1.2) <= half
            widths += half / 24
    assert hits >= 22
    assert 0.03 <= widths <= 0.3


def test_an_axis_counts_by_its_share() -> None:
    moments = drive(ramped(), 1.2, takes=(1.0, 0.5))
    both = measured([moments], AXES, {"slew": 1.0, "near_far": 0.5})[0]
    assert both.flow[0] == pytest.approx(1.2, abs=0.02)
    assert both.asked == pytest.approx(1.5, abs=0.02)


def test_the_least_direction_comes_first() -> None:
    def weaker(asked: Sequence[float], flow: float) -> list[float]:
        return alike(asked, flow if sum(asked) > 0.0 else 0.8 * flow)

    assert [one.ways for one in directions_of(drive(ramped(), 1.4, weaker))] == [(-1, -1), (1, 1)]


def test_drives_of_a_driver_may_be_opposite_and_in_several_logs() -> None:
    alone, both = driven((1.0, 0.0), (0.0, -1.0)), driven((0.99, -1.0))
    logs = [drive(alone, 1.5), drive(both, 1.5)]
    [one] = measured(logs, AXES, ONE)
    assert (one.ways, one.flow[0]) == ((1, -1), pytest.approx(1.5, abs=0.01))


@pytest.mark.parametrize("what", [{"most": 0.8}, {"flow": 0.8}], ids=["valve", "pump"])
def test_an_axis_that_gets_no_faster_alone_is_refused(what: dict[str, float]) -> None:
    says = r"slew alone hardly gets faster up to 100 % .* up to 70 % of that only \(--top\)"
    with pytest.raises(CalibrationError, match=says):
        directions_of(drive(ramped(), **({"flow": 1.2} | what)))
    within = directions_of(drive(ramped(0.7), **({"flow": 0.8} | what)))
    assert within[0].flow[0] == pytest.approx(0.8, abs=0.02)


def test_a_pump_that_one_axis_may_empty_is_not_believed_unseen() -> None:
    strokes = (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)
    with pytest.raises(CalibrationError, match=r"flow at most 1\.00, what one axis takes"):
        directions_of(drive(driven(*strokes), 0.8))
    quick = [0.1 * k for k in range(11)]
    rows = [
        [(v * a, v * b) for v in [*quick, *[1.0] * 100, *quick[::-1], *[0.0] * 50]]
        for a, b in strokes
    ]
    with pytest.raises(CalibrationError, match=r"flow at most 1\.00"):
        directions_of(drive([*rows[0], *rows[1], *rows[2]], 0.8))
    assert directions_of(drive(ramped(), 1.0))[0].flow[0] == pytest.approx(1.0, abs=0.01)
    assert directions_of(drive(driven(*strokes), 1.1))[0].flow[0] == pytest.approx(1.1, abs=0.01)


@pytest.mark.parametrize(
    "strokes",
    [
        [(1.0, 0.0), (1.0, 1.0)],
        [(1.0, 0.0), (0.0, 1.0)],
        [(1.0, 0.0), (0.0, -1.0), (1.0, 1.0)],
        [(1.0, 0.0), (0.0, 0.9), (1.0, 1.0)],  # not so far as at once
    ],
)
def test_a_drive_that_is_missing_is_named(strokes: list[tuple[float, float]]) -> None:
    with pytest.raises(CalibrationError, match="expected slew alone, near_far alone and both"):
        directions_of(drive(driven(*strokes), 1.2))


def test_a_feedback_of_nothing_is_refused() -> None:
    still = [[*moment[:4], RESTS[1]] for moment in drive(ramped(), 1.2)]
    with pytest.raises(CalibrationError, match="near_far alone: expected a steady speed, got 0 "):
        directions_of(still)


def lines(
    moments: list[Moment], file: Path = ROOT / "config/forwarder-robust.yaml", **origin: Any
) -> list[str]:
    return pump_lines(load_deployment(file), AXES, [moments], origin or None)


@pytest.mark.parametrize(
    ("moments", "says"),
    [
        (drive(ramped(), 1.2), "the valve shares the flow: both slow down alike"),
        (drive(ramped(), 1.2, starving), "plain load sensing: slew starves, near_far keeps its"),
        (
            drive(ramped(), 1.2, lambda asked, _: [0.5 * asked[0], 0.8 * asked[1]]),
            "neither alike nor one alone",
        ),
    ],
    ids=["alike", "starving", "neither"],
)
def test_the_lines_say_how_it_is_shared(moments: list[Moment], says: str) -> None:
    if says.startswith("neither"):  # alone nothing is lost
        alone = [(a, b) if bool(a) != bool(b) else None for _, a, _, b, _ in moments]
        full = drive(ramped(), 2.0)
        moments = [f if a else m for a, f, m in zip(alone, full, moments, strict=True)]
    assert says in "\n".join(lines(moments))


def test_enough_oil_and_a_pump_that_was_not_loaded_are_no_flow() -> None:
    enough = lines(drive(ramped(), 3.0), **written_by("calibrate", simulated=True))
    assert enough[2].startswith("enough oil for both: flow at least 1.9")
    assert "hydraulics: { flow: 3 } tells canshaper check so" in enough[3]
    few = lines(drive(ramped(0.4), 1.2))
    assert few[2].startswith("flow at least 0.7")
    assert few[2].endswith(
        "does not load the pump; measure again with a larger --top, or limits.max_pct"
    )
    assert not [line for line in enough + few if line.startswith(("hydraulics", "written"))]


@pytest.mark.parametrize("before", ["", "hydraulics: { flow: 3, shares: { lift: 0.5 } } # guess\n"])
def test_the_flow_goes_into_the_file_rounded_down(file: Path, before: str) -> None:
    file.write_text(file.read_text() + before + "assumed: [hydraulics.flow]\n" * bool(before))
    origin = written_by("calibrate", simulated=False)
    said = lines(drive(ramped(), 1.2), file, **origin)
    assert said[-2:] == [
        "hydraulics: { flow: 1.17 } # lower end; shares: slew 1, near_far 1",
        f"Written to {file}; a running daemon takes it with SIGHUP.",
    ]
    config = load_deployment(file).config
    assert config.hydraulics
    assert (config.hydraulics.flow, config.hydraulics.origin) == (1.17, Origin(**origin))
    assert config.hydraulics.shares == ({"lift": 0.5} if before else {})
    assert not config.assumed
