"""``canshaper demo``: the same drive with anti-sway off and on, measured and drawn."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from canshaper.cli.common import CRANE, SET, echo, fail, loader, picture, picture_line
from canshaper.errors import DriveError

if TYPE_CHECKING:
    from canshaper.design.processes import Transport
    from canshaper.machine.deployment import Deployment
    from canshaper_sim.recording import Recording
    from canshaper_sim.strokes import Script

# What `report.json` says of a drive without a bus.
EXIT_NOT_DRIVEN = 1
LOCKSTEP = "lock-step, no bus"


def demo(
    file: str = typer.Argument(
        "forwarder-robust.yaml", help="Deployment file; by default a shipped one."
    ),
    script: str = typer.Option("demo", "--script", help="What the operator does."),
    out: Path = typer.Option(Path("out/demo"), "--out", help="Directory for picture and report."),
    lockstep: bool = typer.Option(
        False,
        "--lockstep",
        help="Without bus and clock, in a second or two; always so outside Linux.",
    ),
    transport: str = typer.Option(
        "auto", "--transport", help="auto, vcan0 (or another SocketCAN channel), udp_multicast."
    ),
    crane: str | None = CRANE,
    changes: list[str] | None = SET,
) -> None:
    """Drive the simulated crane twice, anti-sway off and on, and show the difference.

    Without FILE it is the recommended deployment, forwarder-robust.yaml. The script "demo" moves
    slew and near-far (or the joints) together. Of several cranes it is the first one.

    Operator, daemon and plant run as three processes and exchange frames on vcan0 where the
    kernel has it, otherwise on python-can's udp_multicast. Prints a table and writes demo.png
    and report.json.

    Examples:

      canshaper demo

      canshaper demo --lockstep --script loading

      canshaper demo forwarder.yaml --lockstep     (the paper's filter)

      canshaper demo --set grapple.l2_m=1.5
    """
    from canshaper.design.processes import choose_transport
    from canshaper.report.console import SafeConsole
    from canshaper.report.metrics import report_dict
    from canshaper.report.table import print_report
    from canshaper_sim.axes import ALL_AXES
    from canshaper_sim.cranes import cranes, one_crane
    from canshaper_sim.operator import script_named
    from canshaper_sim.parameters import changed_parameters

    console = SafeConsole()
    changed_parameters(changes or [])  # wrong ones are named before anything begins
    deployment = loader(file)()
    # A drive on a bus needs Linux' scheduler and sockets.
    way = None if lockstep or sys.platform != "linux" else choose_transport(transport, deployment)
    several = cranes(deployment)
    crane = crane or next(iter(several), None)
    axes = (one_crane(deployment, crane) if crane else deployment).axes
    played = script_named(script, [axis for axis in ALL_AXES if axis in axes])
    console.print(f"Operator script {played.name}, {played.duration_s:g} s, driven twice.")
    if crane:
        console.print(f"Crane: {crane} (of {', '.join(several)})")
    console.print(f"Transport: {way.description if way else LOCKSTEP}")

    try:
        (raw, shaped), missed = _drive_twice(deployment, way, played, crane, changes or [])
    except DriveError as error:
        raise fail(error, EXIT_NOT_DRIVEN) from None
    except KeyboardInterrupt:
        echo("interrupted; every process was stopped, valves neutral", err=True)
        raise typer.Exit(130) from None

    report = report_dict(
        raw,
        shaped,
        transport=way.description if way else LOCKSTEP,
        missed_deadlines=missed,
        facts={"script": played.name, "deployment": str(deployment.path.name)},
    )
    out.mkdir(parents=True, exist_ok=True)
    print_report(report, console)
    (out / "report.json").write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")

    def draw(path: Path) -> None:
        from canshaper.report.plot import draw as draw_drives

        draw_drives(raw, shaped, report, path)

    console.print(picture_line(picture(out / "demo.png", draw)))
    console.print(f"Report: {out / 'report.json'}")


def _drive_twice(
    deployment: "Deployment",
    way: "Transport | None",
    played: "Script",
    crane: str | None,
    changes: list[str],
) -> tuple[list["Recording"], int]:
    """Drives with anti-sway off and on, and the deadlines that the daemon missed in both.

    Args:
        deployment: the machine.
        way: the bus to drive on; None for lock-step.
        played: what the operator does.
        crane: which one, where there are several.
        changes: parameters of the crane, NAME=VALUE.
    """
    from canshaper.design.lockstep import drive
    from canshaper.design.processes import drive_on_bus
    from canshaper.report.console import progress_bar
    from canshaper_sim.parameters import changed_parameters

    recordings, missed = [], 0
    for name, bypass in (("anti-sway off", True), ("anti-sway on", False)):
        with progress_bar(name, played.duration_s) as on_progress:
            options: Any = {"bypass": bypass, "on_progress": on_progress}
            if way is None:
                options |= {"parameters": changed_parameters(changes), "crane": crane}
                recordings.append(drive(deployment, played, **options))
            else:
                run = drive_on_bus(deployment, way, played, changes, **options)
                recordings.append(run.recording)
                missed += run.missed_deadlines
    return recordings, missed
