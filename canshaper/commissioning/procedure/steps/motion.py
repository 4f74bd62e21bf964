"""The first motion, at reduced speed: right axis, right direction, and neutral at once."""

import math
from functools import partial

import numpy as np

from canshaper.commissioning.identification.series import Command
from canshaper.commissioning.procedure.bench import Mode, Task
from canshaper.commissioning.procedure.state import Context, Outcome, Step
from canshaper.commissioning.procedure.steps.check import MOTION
from canshaper.commissioning.procedure.steps.dry import PAUSE_S, ends, figure, show_states
from canshaper.commissioning.procedure.traffic import AxisTraffic, read_traffic
from canshaper.config.bus import REDUCED_PCT
from canshaper.config.source import Source
from canshaper.edit.edit import change
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment
from canshaper_sim.strokes import Script, Stroke

LEVEL = 0.4  # of full deflection
LEAST_MOVED = 0.02  # of full command
# How long after the enable was let go a valve may still be away from neutral: its joystick's and
# its own frame, each of which may have just been missed.
FRAMES = 2
GUIDE = (
    "no one near, the crane free of everything, engine at low speed, a hand on the emergency stop."
    " The controller that drove the valves so far sends no more to them"
)


def run(context: Context) -> Outcome:
    """Let every axis be moved a little, and the enable be let go in motion."""
    deployment = context.deployment
    fast = [n for n, one in deployment.config.axes.items() if one.limits.max_pct > REDUCED_PCT]
    if fast:
        text = f"expected max_pct up to {REDUCED_PCT:g} for the first motion"
        raise UsageError(f"{', '.join(fast)}: {text}; do the step check again, which proposes it")
    log = context.folder / "motion.log"
    axes = [*deployment.axes]
    strokes = ends(axes, LEVEL)
    begin_s = strokes[-1].end_s + PAUSE_S
    last = Stroke(axes[0], begin_s, 2.0, LEVEL)
    script = Script("motion", (*strokes, last), last.end_s + PAUSE_S)
    released = (begin_s + 1.0, last.end_s + 0.5)
    words = (
        f"FIRST MOTION: {GUIDE}. Enable held: a little deflection forth and back of each of"
        f" {', '.join(axes)}; then let go of the enable while {axes[0]} moves."
        f" {script.duration_s:.0f} s."
    )
    context.bench.drive(deployment, log, Task(words, script, Mode.SHAPED, released))
    traffic = read_traffic(log, deployment)
    outcome = Outcome(files=[log])
    show_states(outcome, traffic)
    slowest_s: float | None = None
    for name, axis in traffic.axes.items():
        bound = deployment.axes[name]
        cycle_ms = deployment.joysticks[bound.config.command.joystick].message.cycle_time or 0
        period_ms = bound.period_ticks * deployment.config.tick_ms
        allowed_s = FRAMES * (period_ms + cycle_ms) / 1000.0
        if not _follows(axis):
            text = "its valve did not follow its joystick in both directions"
            outcome.problems.append(f"{name}: {text}: see the picture, then move it again")
        for after_s in _releases(axis):
            slowest_s = max(slowest_s or 0.0, after_s)
            if after_s > allowed_s:
                text = f"neutral only {after_s:.3f} s after the enable was let go"
                outcome.problems.append(f"{name}: {text}, expected {allowed_s:.3f} s; do not go on")
    if slowest_s is None:
        text = "the enable was not let go while an axis moved, or is in no message of a joystick"
        outcome.problems.append(f"{text}: let it go in motion; neutral has to follow at once")
    else:
        outcome.numbers["enable_to_neutral_s"] = round(slowest_s, 3)
        outcome.sheet.print(f"enable let go in motion: neutral after {slowest_s:.3f} s")
    if not context.bench.simulated:
        outcome.sheet.print("Accept it only if each axis moved, and in its right direction.")
    data = Source(deployment.path).data.get("motion", {})
    if names := [name for name, motion in data.items() if motion.get("waits")]:
        outcome.sheet.print(f"Two-axis motion begins with the next step: {', '.join(names)}")
        outcome.edit = partial(_begin, names=names)
    outcome.figures[""] = lambda: figure(traffic, "First motion, at reduced speed")
    return outcome


def _begin(deployment: Deployment, names: list[str]) -> None:
    change(deployment.path, [(("motion", name), {"waits": None}, "") for name in names])


def _follows(axis: AxisTraffic) -> bool:
    """Whether the valve goes to the side of the joystick while that is held, to both sides.

    Slew moves near-far a little too, so what it does besides says nothing.
    """
    time_s, joystick = axis.joystick.arrays()
    valve = Command(*axis.valve.arrays()).at(time_s)
    far = 0.5 * np.abs(joystick).max(initial=0.0)
    sent = [side * valve[side * joystick > far] for side in (1.0, -1.0)]
    return all(len(one) and one.mean() >= LEAST_MOVED for one in sent)


def _releases(axis: AxisTraffic) -> list[float]:
    """How long the valve took to neutral each time the enable was let go while it moved."""
    (time_s, valve), (at_s, enabled) = axis.valve.arrays(), axis.enabled.arrays()
    times_s = []
    for released_s in at_s[1:][(enabled[:-1] > 0.0) & (enabled[1:] == 0.0)]:
        after = np.searchsorted(time_s, released_s)
        if after and abs(valve[after - 1]) > LEAST_MOVED:
            neutral_s = time_s[after:][valve[after:] == 0.0]
            times_s.append(float(neutral_s[0] - released_s) if len(neutral_s) else math.inf)
    return times_s


# Not the file: it gets faster afterwards.
FIRST_MOTION = Step(
    MOTION,
    "First motion, at reduced speed",
    "first motion at reduced speed: each valve follows its joystick, and is neutral when the"
    " enable is let go",
    run,
    writes="`motion` without `waits`",
    needs=("valve", "filter"),
)
