"""``canshaper demo``: one drive with anti-sway off and one with it on, measured and drawn."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from canshaper.cli.common import (
    CRANE,
    DEFAULT,
    EXIT_INTERRUPTED,
    EXPORT,
    PICTURE,
    PLANT,
    REPORT,
    SENSOR,
    SET,
    echo,
    fail,
    loader,
    sensed,
)
from canshaper.errors import DriveError, UsageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from canshaper.campaign.draw import Setting
    from canshaper.design.lockstep import DriveOptions, OnFrame
    from canshaper.design.processes import Transport
    from canshaper.machine.deployment import Deployment
    from canshaper_sim.crane import CraneParameters
    from canshaper_sim.recording import Recording
    from canshaper_sim.strokes import Script

GROUP = "look"

EXIT_NOT_DRIVEN = 1
# Transport of a drive without a bus, in report.json.
LOCKSTEP = "lock-step, no bus"


def demo(
    file: str = typer.Argument(DEFAULT, help="Deployment file; by default a shipped one."),
    sensor: bool = SENSOR,
    script: str = typer.Option(
        "demo",
        "--script",
        help="Script of the operator; `canshaper operator FILE --list` lists them.",
    ),
    rest: float | None = typer.Option(
        None,
        "--rest",
        min=1.0,
        max=120.0,
        metavar="S",
        help="Seconds of rest at the end, to see when the grapple hangs still without anti-sway.",
    ),
    out: Path = typer.Option(Path("out/demo"), "--out", help="Directory for picture and report."),
    lockstep: bool = typer.Option(
        False,
        "--lockstep",
        help="Drive without bus and clock, in a second or two; the only way outside Linux.",
    ),
    transport: str = typer.Option(
        "auto", "--transport", help="auto, vcan0 (or another SocketCAN channel), udp_multicast."
    ),
    seed: int | None = typer.Option(
        None, "--seed", min=0, help="Repeat this drive of `canshaper campaign FILE`, in lock-step."
    ),
    ranges: str | None = typer.Option(
        None,
        "--ranges",
        metavar="FILE",
        help="Draw the drive of --seed from this file's ranges, as `campaign FILE --against` does.",
    ),
    crane: str | None = CRANE,
    plant: Path | None = PLANT,
    changes: list[str] | None = SET,
    export: Path | None = EXPORT,
    picture: Path | None = PICTURE,
    report: Path | None = REPORT,
) -> None:
    """Drive the simulated crane twice, anti-sway off and on, and show the difference.

    Without FILE it drives the recommended deployment, forwarder-robust.yaml. The script "demo"
    moves slew and near-far (or joints, or bridge and trolley) together. If the deployment has
    several cranes, it drives the first one.

    Operator, daemon and plant run as three processes. They exchange frames on vcan0 if the kernel
    has it, else on python-can's udp_multicast. With --lockstep, --seed or --plant, and outside
    Linux, there is no bus. It prints a table and writes demo.png and report.json.

    Examples:

      canshaper demo

      canshaper demo --lockstep --script loading

      canshaper demo --lockstep --script pulse-slew --rest 20

      canshaper demo forwarder-gff.yaml --lockstep  # the paper's filter

      canshaper demo --set grapple.l2_m=1.5

      canshaper demo --sensor --set grapple.l2_m=1.5

      canshaper demo --seed 34 --export drive.mcap

      canshaper demo new.yaml --seed 34 --ranges old.yaml

      canshaper demo --plant crane.fmu
    """
    from canshaper.cli.results import Results
    from canshaper.design.processes import choose_transport
    from canshaper.report.console import print_report
    from canshaper.report.metrics import report_dict
    from canshaper_sim.cranes import cranes, one_crane
    from canshaper_sim.joysticks import switches_off
    from canshaper_sim.operator import script_for
    from canshaper_sim.parameters import changed_parameters

    if (ranges is not None and seed is None) or (seed is not None and (crane or rest) is not None):
        raise UsageError("--seed: expected with --ranges, and without --crane or --rest")
    deployment = loader(sensed(file, sensor))()
    if not switches_off(deployment):
        echo(f"WARNING: {file}: no joystick has anti_sway_off: both drives are shaped", err=True)
    nominal = changed_parameters(changes or [], deployment)
    results = Results("Drive without and with filters", deployment, report, picture)
    lockstep = lockstep or seed is not None or plant is not None
    # A drive on a bus needs Linux' scheduler and sockets.
    way = None if lockstep or sys.platform != "linux" else choose_transport(transport, deployment)
    several = cranes(deployment)
    crane = crane or next(iter(several), None)
    options: DriveOptions = {"parameters": nominal, "crane": crane}
    if plant:
        options["unit"] = plant
    drawn = None if seed is None else _drawn(deployment, seed, ranges, nominal, plant)
    if drawn:
        played, options = drawn.script, drawn.options
    else:
        played = script_for(one_crane(deployment, crane) if crane else deployment, script)
        if rest is not None:
            released_s = max((stroke.end_s for stroke in played.strokes), default=0.0)
            played = replace(played, duration_s=released_s + rest)
    results.print(f"Operator script {played.name}, {played.duration_s:g} s, driven twice.")
    if crane:
        results.print(f"Crane: {crane} (of {', '.join(several)})")
    results.print(f"Transport: {way.description if way else LOCKSTEP}")

    raw, shaped, missed = _driven(deployment, way, played, options, changes or [], export)
    if drawn:  # residual swing counts from the same time as in the campaign
        raw, shaped = (replace(one, dwell_s=drawn.dwell_s) for one in (raw, shaped))
    measures = report_dict(
        raw,
        shaped,
        transport=way.description if way else LOCKSTEP,
        missed_deadlines=missed,
        still_deg=deployment.config.still_deg,
        facts={"script": played.name, "deployment": str(deployment.path.name)},
    )
    out.mkdir(parents=True, exist_ok=True)
    print_report(measures, results)
    (out / "report.json").write_text(json.dumps(measures, indent=2) + "\n", encoding="utf-8")

    def figure() -> "Figure":
        from canshaper.report.plot import figure as of_drives

        return of_drives(raw, shaped, measures)

    results.picture_line(results.picture(out / "demo.png", figure))
    results.print(f"Numbers: {out / 'report.json'}")
    results.write()


def _drawn(
    deployment: "Deployment",
    seed: int,
    ranges: str | None,
    nominal: "CraneParameters",
    plant: Path | None,
) -> "Setting":
    """Return the drive that a campaign of ``ranges``, else of this file, draws for a seed."""
    from canshaper.campaign.draw import check_same_axes, draw_drive, on_unit
    from canshaper_sim.recorder import dwell_s

    first = loader(ranges)() if ranges else deployment
    check_same_axes(first, deployment)
    longest_s = max(map(dwell_s, (first, deployment)))
    drawn = draw_drive(deployment, seed, first.config.uncertainty, nominal, longest_s)
    return on_unit(drawn, plant, nominal) if plant else drawn


def _driven(
    deployment: "Deployment",
    way: "Transport | None",
    played: "Script",
    options: "DriveOptions",
    changes: list[str],
    export: Path | None,
) -> tuple["Recording", "Recording", int]:
    """Drive twice, and export the second drive if asked; a failed drive or Ctrl-C ends the verb."""
    from canshaper.recording.export import exporting

    try:
        with exporting(export, deployment, options.get("parameters")) as exported:
            on_frame = exported.seen if exported else None
            drives, missed = _drive_twice(deployment, way, played, options, changes, on_frame)
    except DriveError as error:
        raise fail(error, EXIT_NOT_DRIVEN) from None
    except KeyboardInterrupt:
        echo("interrupted; every process was stopped, valves neutral", err=True)
        raise typer.Exit(EXIT_INTERRUPTED) from None
    return drives[0], drives[1], missed


def _drive_twice(
    deployment: "Deployment",
    way: "Transport | None",
    played: "Script",
    options: "DriveOptions",
    changes: list[str],
    on_frame: "OnFrame | None",
) -> tuple[list["Recording"], int]:
    """Drive with anti-sway off and on; return both drives and the deadlines missed in them.

    Args:
        deployment: the machine.
        way: the bus to drive on; None for lock-step.
        played: what the operator does.
        options: options of a drive in lock-step.
        changes: parameters of the crane on a bus, NAME=VALUE.
        on_frame: called with the frames of the drive with anti-sway on.
    """
    from canshaper.design.lockstep import drive
    from canshaper.design.processes import drive_on_bus
    from canshaper.report.console import progress_bar

    recordings, missed = [], 0
    for name, bypass in (("anti-sway off", True), ("anti-sway on", False)):
        with progress_bar(name, played.duration_s) as on_progress:
            if way is None:
                options["bypass"] = bypass
                listener = None if bypass else on_frame
                recordings.append(drive(deployment, played, on_progress, listener, **options))
            else:
                run = drive_on_bus(
                    deployment,
                    way,
                    played,
                    changes,
                    bypass=bypass,
                    on_progress=on_progress,
                    on_frame=None if bypass else on_frame,
                )
                recordings.append(run.recording)
                missed += run.missed_deadlines
    return recordings, missed
