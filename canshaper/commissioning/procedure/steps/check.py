"""Is the file fit to start, and slow enough for the first motion?"""

from functools import partial

from matplotlib.figure import Figure

from canshaper.commissioning.assumed import confirmed
from canshaper.commissioning.likely_mistakes import warnings_of
from canshaper.commissioning.procedure.state import FILE, Context, Outcome, Step
from canshaper.commissioning.stopping import Stopping, print_stopping, stopping
from canshaper.config.bus import REDUCED_PCT
from canshaper.config.source import Source
from canshaper.edit.edit import change, of_limits
from canshaper.machine.deployment import Deployment
from canshaper.machine.stop_distance import rehearsed_valves, unstated
from canshaper.report import style
from canshaper.report.console import axis_title

MOTION = "motion"  # the step of that name
EVENTS = ("joystick released", "joystick reversed", "joystick lost", "enable lost", "limits allow")


def run(context: Context) -> Outcome:
    """Check the whole file, and propose reduced speed before the first motion."""
    deployment = context.deployment
    outcome = Outcome()
    for name, bus in deployment.config.buses.items():
        if load := deployment.load(name):
            outcome.numbers[f"{name}_load_pct"] = round(100.0 * load.share, 1)
            outcome.sheet.print(
                f"bus {name}: {load.messages} messages load {load.share:.0%} of {bus.bitrate} bit/s"
            )
    print_stopping(deployment, outcome.sheet)
    outcome.sheet.print(*deployment.identity.lines())
    outcome.numbers["digest"] = f"{deployment.identity.digest:#06x}"
    for doubt in warnings_of(deployment):
        outcome.sheet.print(f"WARNING: {doubt}")
    source = Source(deployment.path)
    faults = [*unstated(deployment)]
    faults += [] if context.bench.simulated else rehearsed_valves(deployment.config)
    outcome.problems += [str(source.problem(place, text)) for place, text in faults]
    axes = stopping(deployment)
    outcome.figures[""] = lambda: figure(axes)
    limits = {name: axis.limits for name, axis in deployment.config.axes.items()}
    first = MOTION not in context.numbers
    fast = [name for name, one in limits.items() if first and one.max_pct > REDUCED_PCT]
    if fast:
        outcome.sheet.print(f"The first motion is at reduced speed: {', '.join(fast)}")
    allowed = []
    for name, one in limits.items():
        key = f"axes.{name}.limits.stop_distance_m"
        if key in deployment.config.assumed:
            allowed.append(key)
            outcome.sheet.print(
                f"{key}: {one.stop_distance_m:g} m is a guess: to write this step is to allow the"
                f" tip of {name} to travel so far when it stops; type less where there is less room"
            )
    if fast or allowed:
        outcome.edit = partial(_write, fast=fast, allowed=allowed)
    return outcome


def _write(deployment: Deployment, fast: list[str], allowed: list[str]) -> None:
    sections, slow = deployment.config.axes, {"max_pct": REDUCED_PCT}
    slower = [of_limits(name, sections[name], slow) for name in fast]
    change(deployment.path, [*slower, *confirmed(deployment.path, allowed)])


def figure(axes: list[Stopping]) -> Figure:
    """How far each axis travels on after each event, and how far its limits allow."""
    height = 170 + 330 * len(axes)
    fig = style.print_figure(height)
    for number, axis in enumerate(axes):
        bottom = (height - 110 - 330 * (number + 1) + 75) / height
        panel = fig.add_axes((0.2, bottom, 0.76, 215 / height))
        style.plain(panel, size=style.TEXT_PT)
        unit, scale = ("s of full speed", 1.0) if axis.speed.m_s is None else ("m", axis.speed.m_s)
        style.titled(panel, f"{axis_title(axis.name)}, {unit}", style.TITLE_PT)
        ways = axis.travel
        events = (ways.release, ways.reversal, ways.lost, ways.enable, axis.allowed_s)
        colours = [style.SHAPED_COLOUR] * (len(events) - 1) + [style.RAW_COLOUR]
        panel.barh(EVENTS, [scale * way_s for way_s in events], color=colours, height=0.6)
        panel.invert_yaxis()
        if axis.stated_m is not None and axis.speed.m_s is not None:
            panel.axvline(axis.stated_m, color=style.TEXT_COLOUR, linewidth=1.2)
    style.headline(fig, "Travel from full speed; the line is stop_distance_m")
    return fig


CHECK = Step(
    "check",
    "Check",
    "as `canshaper check`: stopping distances, bus load, what does not fit, oil not yet measured",
    run,
    writes="`max_pct: 40`, for the first motion; `stop_distance_m` as allowed by you",
    needs=(FILE,),
)
