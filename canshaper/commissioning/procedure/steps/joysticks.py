"""Steps: are the buses alive; the joystick of each axis, found by moving it."""

from functools import partial
from itertools import pairwise
from statistics import median

from matplotlib.figure import Figure

from canshaper.commissioning.doctor.interfaces import bus_findings
from canshaper.commissioning.doctor.joysticks import arrival_findings
from canshaper.commissioning.doctor.verdict import Finding, Level
from canshaper.commissioning.procedure.bench import STILL_MOVES, Task
from canshaper.commissioning.procedure.state import Context, Outcome, Step
from canshaper.commissioning.procedure.traffic import AxisTraffic, Traffic, read_traffic
from canshaper.edit.edit import change
from canshaper.machine.deployment import Deployment
from canshaper.report import style
from canshaper.report.console import axis_title, new_table
from canshaper_sim.strokes import Script, Stroke

LISTEN_S = 10.0
MOST_DRAWN_S = 1.0  # of a picture in which single frames are seen
MOST_ROWS = 24


def listen(context: Context) -> Outcome:
    """Listen, and judge every message that the deployment needs, and a machine's interfaces."""
    deployment = context.deployment
    log = context.folder / "buses.log"
    words = f"Switch the machine on; touch nothing while it listens, {LISTEN_S:.0f} s."
    context.bench.drive(deployment, log, Task(words, Script("rest", (), LISTEN_S)))
    traffic = read_traffic(log, deployment)
    outcome = Outcome(files=[log])
    findings = arrival_findings(deployment, traffic.inputs)
    if not context.bench.simulated:
        findings += bus_findings(deployment.config.buses, deployment.config.tick_ms)
    for name in deployment.config.buses:
        count = sum(len(times) for key, times in traffic.frames.items() if key[0] == name)
        outcome.numbers[f"{name}_frames_per_s"] = round(count / LISTEN_S, 1)
        if not count:
            remedy = "is the machine on, the interface up, its bit rate right?"
            findings.append(Finding(f"bus {name}", Level.BAD, "no frame was received", remedy))
    table = new_table("message", "frames", "period, ms")
    for name, times in _rows(traffic, deployment):
        gaps = [1000.0 * (b - a) for a, b in pairwise(times)]
        table.add_row(name, str(len(times)), f"{median(gaps):.1f}" if gaps else "-")
    outcome.sheet.print(table)
    for finding in findings:
        outcome.sheet.print(f"{finding.level.value}: {finding.subject}: {finding.found}")
        if finding.level is Level.BAD:
            outcome.problems.append(f"{finding.subject}: {finding.found}: {finding.remedy}")
    if traffic.frames:
        outcome.figures[""] = lambda: frames_figure(traffic, deployment)
    return outcome


def _rows(traffic: Traffic, deployment: Deployment) -> list[tuple[str, list[float]]]:
    """Return (bus and message name, arrival times in s of its frames) of each message, sorted.

    A message that the DBC files lack has its identifier in place of a name.
    """
    rows = []
    for (bus, can_id, extended), times in traffic.frames.items():
        names = deployment.messages.named([(can_id, extended)])
        digits = 8 if extended else 3
        rows.append((f"{bus} {names[0] if names else f'{can_id:0{digits}X}'}", times))
    return sorted(rows)


def frames_figure(traffic: Traffic, deployment: Deployment) -> Figure:
    """Draw every frame of the first second, a row for each message."""
    rows = _rows(traffic, deployment)[:MOST_ROWS]
    height = 330 + 45 * len(rows)
    fig = style.print_figure(height)
    panel = fig.add_axes((0.27, 190 / height, 0.7, 45 * len(rows) / height))
    style.plain(panel, size=style.TEXT_PT)
    for number, (_, times) in enumerate(rows):
        drawn = [time for time in times if time <= MOST_DRAWN_S]
        panel.plot(drawn, [number] * len(drawn), "|", color=style.SHAPED_COLOUR, markersize=5)
    panel.set_yticks(range(len(rows)), [name for name, _ in rows])
    panel.set_ylim(len(rows) - 0.5, -0.5)
    panel.set_xlim(0.0, MOST_DRAWN_S)
    style.label(panel, "time, s")
    style.headline(fig, "The frames of the first second")
    return fig


BUSES = Step(
    "buses",
    "Are the buses alive?",
    "listens for 10 s: is every message there that the file names, and regular? On "
    "the machine the interfaces too",
    listen,
)


MOVE_S = 10.0
LEAST = 0.9  # part of full that both ends have to reach
MOVED = 0.5  # part of full from which on a signal counts as moved


def move_joysticks(context: Context) -> Outcome:
    """Let every joystick be moved to both ends, and find the signal that moves."""
    deployment = context.deployment
    outcome = Outcome()
    table = new_table("axis", "moved", "least, %", "most, %", "enable held, %")
    seen: dict[str, AxisTraffic] = {}
    wrong: dict[str, tuple[str, str]] = {}
    for name in deployment.axes:
        log = context.folder / f"joystick-{name}.log"
        words = (
            f"Enable held, move the joystick of {name} to its end in positive direction, then to"
            f" the other end, and let go; touch no other joystick. {MOVE_S:.0f} s. {STILL_MOVES}"
        )
        strokes = (Stroke(name, 1.0, 2.0, 1.0), Stroke(name, 4.0, 2.0, -1.0))
        context.bench.drive(deployment, log, Task(words, Script("ends", strokes, MOVE_S)))
        traffic = read_traffic(log, deployment)
        outcome.files.append(log)
        axis = seen[name] = traffic.axes[name]
        moved = _moved(traffic)
        least, most = axis.reach
        held = _held(axis)
        table.add_row(
            name,
            ", ".join(moved) or "-",
            f"{100 * least:.0f}",
            f"{100 * most:.0f}",
            "-" if held is None else f"{100 * held:.0f}",
        )
        outcome.numbers[name] = {
            "signal": moved[0] if moved else None,
            "least_pct": round(100 * least, 1),
            "most_pct": round(100 * most, 1),
        }
        other = _other_signal(deployment, name, moved)
        if other:
            wrong[name] = other
        elif fault := _fault(deployment, name, axis, moved):
            outcome.problems.append(fault)
    outcome.sheet.print(table)
    for name, (joystick, signal) in wrong.items():
        outcome.sheet.print(f"{name}: the file names another signal than {joystick}.{signal}")
    outcome.figures[""] = lambda: joysticks_figure(seen)
    if wrong:
        outcome.edit = partial(_write, wrong=wrong)
    return outcome


def _moved(traffic: Traffic) -> list[str]:
    """Return the signals that moved, the farthest first."""
    far = {name: most - least for name, (least, most) in traffic.moved.items()}
    return sorted((name for name in far if far[name] > MOVED), key=lambda name: -far[name])


def _held(axis: AxisTraffic) -> float | None:
    """Return the part of the deflected time with the enable switch held; None: not known."""
    if len(axis.enabled.value) != len(axis.joystick.value):
        return None
    deflected = [
        enabled
        for enabled, value in zip(axis.enabled.value, axis.joystick.value, strict=True)
        if abs(value) > MOVED
    ]
    return sum(deflected) / len(deflected) if deflected else None


def _other_signal(deployment: Deployment, name: str, moved: list[str]) -> tuple[str, str] | None:
    """Return joystick and signal that alone moved where the file names others; else None."""
    command = deployment.axes[name].config.command
    own = f"{deployment.joysticks[command.joystick].message.name}.{command.signal}"
    if len(moved) != 1 or moved[0] == own:
        return None
    message, _, signal = moved[0].partition(".")
    names = [n for n, one in deployment.joysticks.items() if one.message.name == message]
    return (names[0], signal) if names else None


def _fault(deployment: Deployment, name: str, axis: AxisTraffic, moved: list[str]) -> str | None:
    """Return the fault of a joystick with what to do; None for none."""
    command = deployment.axes[name].config.command
    own = f"{deployment.joysticks[command.joystick].message.name}.{command.signal}"
    least, most = axis.reach
    text = None
    if max(-least, most) < MOVED and moved:
        text = f"{moved[0]} moved, and {own} of the file did not: put its message into joysticks:"
        text += " of the file, then again"
    elif max(-least, most) < MOVED:
        text = "no signal moved: was it the right joystick? Is its message in the DBC files?"
    elif len(moved) > 1:
        text = f"several moved ({', '.join(moved)}): move the one joystick straight, then again"
    elif min(-least, most) < LEAST:
        text = f"reached {100 * least:.0f} to {100 * most:.0f} %: move it to both ends; else its"
        text += " range in the DBC is wrong"
    elif next(value for value in axis.joystick.value if abs(value) > MOVED) < 0.0:
        text = f"went to negative values first: swap the sign of {own} in the DBC (factor, range)"
    elif (held := _held(axis)) is not None and held < LEAST:
        text = "the enable switch was not seen held: hold it; else the file names another one"
    return f"{name}: {text}" if text else None


def _write(deployment: Deployment, wrong: dict[str, tuple[str, str]]) -> None:
    values = {n: {"joystick": j, "signal": signal} for n, (j, signal) in wrong.items()}
    change(deployment.path, [(("axes", n, "command"), one, "") for n, one in values.items()])


def joysticks_figure(axes: dict[str, AxisTraffic]) -> Figure:
    """Draw the demand of each axis over time, decoded as the file says."""
    height = 150 + 260 * len(axes)
    fig = style.print_figure(height)
    for number, (name, axis) in enumerate(axes.items()):
        bottom = height - 90 - 260 * (number + 1) + 85
        panel = fig.add_axes((0.11, bottom / height, 0.86, 150 / height))
        style.plain(panel, size=style.TEXT_PT)
        style.titled(panel, axis_title(name), style.TITLE_PT)
        style.zero_line(panel)
        values = [100.0 * value for value in axis.joystick.value]
        panel.plot(axis.joystick.time_s, values, color=style.SHAPED_COLOUR, linewidth=1.4)
        panel.set_xlim(0.0, MOVE_S)
        panel.set_ylim(-110.0, 110.0)
        style.label(panel, "time, s", "joystick, %")
    style.headline(fig, "Each joystick, moved to both of its ends")
    return fig


JOYSTICKS = Step(
    "joysticks",
    "Joysticks, found by moving them",
    "each joystick moved to both ends: which signal moves, its range and direction, "
    "the enable switch",
    move_joysticks,
    writes="`command`, where another joystick of the file moves",
)
