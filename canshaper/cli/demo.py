"""``canshaper demo``: the same drive with anti-sway off and on, measured and drawn."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from canshaper.cli.common import INSTALL_TOOLS, fail, loader
from canshaper.cli.console import SafeConsole, echo
from canshaper.cli.sim import SET

if TYPE_CHECKING:
    from canshaper_sim.recording import Recording

# What `report.json` says of a drive without a bus.
LOCKSTEP = "lock-step, no bus"


def demo(
    file: str = typer.Argument("forwarder.yaml", help="Deployment file; by default a shipped one."),
    script: str = typer.Option("demo", "--script", help="What the operator does."),
    out: Path = typer.Option(Path("out/demo"), "--out", help="Directory for picture and report."),
    lockstep: bool = typer.Option(
        False, "--lockstep", help="Without bus and clock, in a second or two."
    ),
    transport: str = typer.Option(
        "auto", "--transport", help="auto, vcan0 (or another SocketCAN channel), udp_multicast."
    ),
    changes: list[str] | None = SET,
) -> None:
    """Drive the simulated crane twice, anti-sway off and on, and show the difference.

    Operator, daemon and plant run as three processes and exchange frames on vcan0 where the
    kernel has it, otherwise on python-can's udp_multicast. Prints a table and writes demo.png
    and report.json.

    Examples:

      canshaper demo

      canshaper demo --lockstep --script loading

      canshaper demo --set grapple.l2_m=1.5
    """
    from canshaper.design.lockstep import drive
    from canshaper.design.processes import choose_transport, drive_on_bus
    from canshaper.errors import ConfigError, DriveError
    from canshaper.report.metrics import report_dict
    from canshaper.report.table import print_report
    from canshaper_sim.operator import script_named
    from canshaper_sim.parameters import changed_parameters

    console = SafeConsole()
    try:
        played = script_named(script)
        crane = changed_parameters(changes or [])
        load = loader(file)
        deployment = load()
        way = None if lockstep else choose_transport(transport, deployment)
    except (ConfigError, DriveError, ValueError) as error:
        raise fail(error) from None
    console.print(f"Operator script {played.name}, {played.duration_s:g} s, driven twice.")
    console.print(f"Transport: {way.description if way else LOCKSTEP}", highlight=False)

    recordings: dict[str, Recording] = {}
    missed = 0
    try:
        with Progress(
            TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn(), console=console
        ) as progress:
            for name, bypass in (("anti-sway off", True), ("anti-sway on", False)):
                task = progress.add_task(f"{name:13}", total=played.duration_s)

                def tell(seconds: float, task: Any = task) -> None:
                    progress.update(task, completed=seconds)

                if way is None:
                    recordings[name] = drive(
                        deployment, played, bypass=bypass, parameters=crane, progress=tell
                    )
                else:
                    run = drive_on_bus(
                        deployment, way, played, changes or [], bypass=bypass, progress=tell
                    )
                    recordings[name] = run.recording
                    missed += run.missed_deadlines
                tell(played.duration_s)
    except DriveError as error:
        echo(str(error), err=True)
        raise typer.Exit(1) from None
    except KeyboardInterrupt:
        echo("interrupted; every process was stopped, valves neutral", err=True)
        raise typer.Exit(130) from None

    raw, shaped = recordings["anti-sway off"], recordings["anti-sway on"]
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
    _draw(raw, shaped, report, out / "demo.png", console)
    console.print(f"Report: {out / 'report.json'}", highlight=False)


def _draw(
    raw: "Recording", shaped: "Recording", report: dict[str, Any], path: Path, console: Console
) -> None:
    try:
        from canshaper.report.plot import draw
    except ImportError:
        console.print(f"No picture: matplotlib is missing: {INSTALL_TOOLS}", markup=False)
        return
    draw(raw, shaped, report, path)
    console.print(f"Picture: {path}", highlight=False)
