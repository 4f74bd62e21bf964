"""Are the buses alive, and the messages of the joysticks regular?"""

from itertools import pairwise
from statistics import median

from matplotlib.figure import Figure

from canshaper.commissioning.doctor.interfaces import bus_findings
from canshaper.commissioning.doctor.listen import arrival_findings
from canshaper.commissioning.doctor.verdict import Finding, Level
from canshaper.commissioning.procedure.bench import Task
from canshaper.commissioning.procedure.state import Context, Outcome, Step
from canshaper.commissioning.procedure.traffic import Traffic, read_traffic
from canshaper.machine.deployment import Deployment
from canshaper.report import style
from canshaper.report.console import new_table
from canshaper_sim.strokes import Script

LISTEN_S = 10.0
MOST_DRAWN_S = 1.0  # of a picture in which single frames are seen
MOST_ROWS = 24


def run(context: Context) -> Outcome:
    """Listen, and look at every message that the deployment needs."""
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
        outcome.figures[""] = lambda: figure(traffic, deployment)
    return outcome


def _rows(traffic: Traffic, deployment: Deployment) -> list[tuple[str, list[float]]]:
    """Messages by bus and name, or by identifier where the DBC files have none."""
    rows = []
    for (bus, can_id, extended), times in traffic.frames.items():
        names = deployment.messages.named([(can_id, extended)])
        digits = 8 if extended else 3
        rows.append((f"{bus} {names[0] if names else f'{can_id:0{digits}X}'}", times))
    return sorted(rows)


def figure(traffic: Traffic, deployment: Deployment) -> Figure:
    """Every frame of the first second, a row a message."""
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
    run,
)
