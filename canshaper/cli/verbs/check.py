"""``canshaper check``: check a deployment before it starts."""

import json
from dataclasses import asdict
from itertools import groupby
from typing import TYPE_CHECKING, Any

import typer

from canshaper.cli.common import EXIT_WRONG, FILE, echo, loader, print_warnings
from canshaper.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from canshaper.config.bus import Bus
    from canshaper.config.crane import Motion
    from canshaper.machine.deployment import Deployment
    from canshaper.machine.used_message import NamedCode

GROUP = "setup"

# What the joysticks move while the daemon is away, by ``fallback`` of the gateway.
FALLBACKS = {
    "stop": "no joystick does without us",
    "neutral": "neutral joysticks do without us",
    "pass": "WARNING: without us the raw joystick moves the machine",
}


def check(
    file: str = FILE,
    as_json: bool = typer.Option(False, "--json", help="Print everything as JSON."),
) -> None:
    """Load a deployment against its DBC files and report every problem at once.

    It shows how far each axis still travels after release, reversal, lost joystick and lost enable,
    and how far its limits allow; for which pendulums its filters hold, and what they leave of the
    swing at the ends of that range; and what each named value (VAL_) means in the signals that are
    read.

    Exit code 0 when the deployment is good, 2 when it is not. Warnings do not change the exit code.
    It warns of:

    - faults of the DBC files in messages that the deployment does not use, and a table of values
    (VAL_) without its signal;

    - a bus that is loaded above 50 % at its bit rate, and an interface of this machine that is not
    the device of its bus;

    - an axis that may travel on for more than 2 m without a stop_distance_m in the file: run does
    not start with it;

    - a filter that was designed for another swing, valve or tail than the file has now, and one
    that leaves more than a tenth of the swing;

    - numbers that were measured on a simulated crane, or are assumed;

    - what is possible but usually a mistake, such as one joystick signal on two valves.

    Examples:

      canshaper check config/forwarder-robust.yaml

      canshaper check config/forwarder-robust.yaml --json
    """
    from canshaper_sim.parameters import changed_parameters

    try:
        deployment = loader(file)()
        changed_parameters([], deployment)  # parameters of its simulated crane
    except ConfigError as error:
        if as_json:
            problems = [asdict(problem) for problem in error.problems]
            echo(json.dumps({"file": file, "good": False, "problems": problems}, indent=2))
        else:
            echo(str(error), err=True)
            count = len(error.problems)
            echo(f"{count} problem{'s' if count > 1 else ''}", err=True)
        raise typer.Exit(EXIT_WRONG) from None
    if as_json:
        echo(json.dumps(_as_dict(deployment), indent=2))
    else:
        _print(deployment)


def _as_dict(deployment: "Deployment") -> dict[str, Any]:
    """Return all results of a good deployment for --json; travel in seconds of full speed."""
    from canshaper.commissioning.likely_mistakes import warnings_of
    from canshaper.commissioning.stopping import stopping
    from canshaper.design.tuning.verdict import verdicts

    config = deployment.config
    loads = {bus: deployment.load(bus) for bus in config.buses}
    return {
        "file": str(deployment.path),
        "good": True,
        "problems": [],
        "warnings": [asdict(warning) for warning in warnings_of(deployment)],
        "not_used": [asdict(warning) for warning in deployment.messages.warnings()[1]],
        "digest": f"{deployment.identity.digest:#06x}",
        "identity": deployment.identity.lines()[1:],
        "buses": {
            name: {
                "interface": bus.interface,
                "channel": bus.channel,
                "bitrate": bus.bitrate,
                "load": load.share if (load := loads[name]) else None,
                "match": _match(bus) if bus.match else None,
            }
            for name, bus in config.buses.items()
        },
        "hydraulics": config.hydraulics and config.hydraulics.model_dump(exclude_none=True),
        "filters": [{"place": [*place], **one.as_dict()} for place, one in verdicts(deployment)],
        "codes": [code._asdict() for code in deployment.codes],
        "start_values": [one._asdict() for one in deployment.starts],
        "axes": {
            one.name: {
                "filter": config.axes[one.name].filter.kind,
                "valve": config.axes[one.name].valve.message,
                "full_speed_m_s": one.speed.m_s,
                "travel_s": asdict(one.travel),
                "needed_s": one.needed_s,
                "allowed_s": one.allowed_s,
                "stop_distance_m": one.stated_m,
                "ends": (ends := config.axes[one.name].limits.ends) and ends.model_dump(),
            }
            for one in stopping(deployment)
        },
    }


def _print(deployment: "Deployment") -> None:
    """Print all results of a good deployment, warnings last."""
    from canshaper.commissioning.likely_mistakes import warnings_of
    from canshaper.commissioning.stopping import print_stopping
    from canshaper.design.tuning.verdict import verdicts
    from canshaper.gate.build import record_of
    from canshaper.report.console import SafeConsole

    config = deployment.config
    echo(f"{deployment.path}: good")
    print_warnings(*deployment.messages.warnings(), "not used")
    for name, bus in config.buses.items():
        echo(f"  bus {name}: {bus.interface} {bus.channel}{_load(deployment, name)}")
        if bus.match:
            echo(f"    match {_match(bus)}")
    if gateway := config.gateway:
        ends, away = " and ".join(gateway.between), FALLBACKS[gateway.fallback]
        echo(f"  gateway between {ends}: others pass by the {gateway.forwarding}, {away}")
    for name, axis in deployment.axes.items():
        valve, joystick = axis.config.valve, axis.config.command
        period_ms = axis.period_ticks * config.tick_ms
        echo(
            f"  axis {name}: {config.joysticks[joystick.joystick].message}.{joystick.signal}"
            f" -> {axis.config.filter.kind} -> {valve.message}.{valve.signal} every {period_ms} ms"
        )
        for line in _of_axis(deployment, name):
            echo(f"    {line}")
    judged = sorted(verdicts(deployment), key=lambda one: one[1].left)[-1:]
    lines = [f"  worst filter: {place[1]}, {verdict}" for place, verdict in judged]
    for line in (*lines, *(_motion(deployment, motion) for motion in config.motion.values())):
        echo(line)
    moved = {motion.slew for motion in config.motion.values()}
    for name, section in config.axes.items():
        if section.slewing and section.sway and name not in moved:
            echo(f"  {name} is in no motion: together with another axis it leaves more swing;")
            echo("    a motion takes one axis that moves the tip in and out, which joints are not")
    for message, starts in groupby(deployment.starts, lambda one: one.message):
        values = ", ".join(f"{one.signal} {one.value:g} {one.unit}".rstrip() for one in starts)
        echo(f"  {message} also carries {values}, used by no axis")
    _print_codes(deployment.codes)
    identity = deployment.identity
    echo(f"  digest {identity.digest:#06x} of deployment, DBC files and program:")
    for line in identity.lines()[1:]:
        echo(f"    {line}")
    print_stopping(deployment, SafeConsole())
    if unchecked := record_of(deployment).unchecked:
        names = ", ".join(unchecked)
        echo(f"  the gate does not know the checksum of {names}: it is of another package")
    for warning in warnings_of(deployment):
        echo(f"WARNING: {warning}")


def _of_axis(deployment: "Deployment", name: str) -> "Iterator[str]":
    """Yield lines on sensor, end stops, oil and pendulums of an axis."""
    from canshaper.shaping.registry import KINDS

    config = deployment.config
    axis = config.axes[name]
    if sensor := axis.sway_sensor:
        does = "damps" if sensor.use == "damp" else "is watched"
        yield f"sway sensor {sensor.message}.{sensor.signal} {does}"
    if e := axis.limits.ends:
        yield f"end stops {e.message}.{e.signal} {e.lowest:g} to {e.highest:g}, margin {e.margin:g}"
    if oil := config.hydraulics:
        others = "measured" if oil.others_measured else f"{oil.others:g}"
        text = f"takes {oil.shares.get(name, 1.0):g} of {oil.flow:g} full axis flows of the pump"
        yield f"{text}, others {others}"
    if axis.sway and KINDS[axis.filter.kind].needs_sway:
        yield f"pendulum: {'; '.join(_pendulums(deployment, name))} of the swing left"


def _print_codes(codes: "Sequence[NamedCode]") -> None:
    """Print the meaning of named values; signals with the same meanings share a line."""
    meanings: dict[str, dict[str, list[str]]] = {}
    for code in codes:
        of_signal = meanings.setdefault(f"{code.message}.{code.signal}", {})
        of_signal.setdefault(code.means, []).append(f'{code.code:g} "{code.name}"')
    signals: dict[str, list[str]] = {}
    for signal, names in meanings.items():
        text = "; ".join(f"{', '.join(named)}: {means}" for means, named in names.items())
        signals.setdefault(text, []).append(signal)
    for text, alike in signals.items():
        echo(f"  {', '.join(alike)}: {text}")


def _match(bus: "Bus") -> str:
    """Return in words whether ``match`` of a bus holds here, or why it could not be looked at."""
    from canshaper.bus.device import match_fault, whereabouts

    try:
        fault = match_fault(bus)
    except OSError as error:
        return f"not looked at: {bus.channel}: {error.strerror}{whereabouts(bus)}"
    return f"WARNING: {fault}" if fault else "holds now"


def _motion(deployment: "Deployment", motion: "Motion") -> str:
    """Return a line on how far the motion moves near-far without its joystick."""
    if motion.near_far is None:
        return f"  motion of {motion.slew} alone: nothing is known of near-far"
    from canshaper.shaping.two_axis_motion import farthest_m

    axis = deployment.axes[motion.near_far].config
    assert axis.sway is not None  # checked with the deployment
    speed_m_s = motion.max_pct / 100.0 * axis.sway.full_speed_m_s
    path_m = motion.max_path_m
    most_m = farthest_m(path_m, damps=axis.damps)
    sources = f" ({path_m:g} for slewing, as much to damp by its sway sensor)" if axis.damps else ""
    return (
        f"  NOTE: while {motion.slew} moves, {motion.near_far} moves too without its joystick: by"
        f" up to {speed_m_s:.2g} m/s, {most_m:g} m in or out{sources}, {motion.max_s:g} s"
    )


def _pendulums(deployment: "Deployment", axis: str) -> "Iterator[str]":
    """Yield for each filter its range of pendulum lengths, m, and the swing left at both ends, %.

    The range is that of its design, else that from which a campaign draws.
    """
    from canshaper.design.tuning.evaluate import evaluate
    from canshaper.design.tuning.verdict import on_axis
    from canshaper.shaping.sway import GRAVITY_M_S2, SwayMode

    config, usual_pct = deployment.axes[axis].config, deployment.config.uncertainty.length_pct
    own = "load not known " if config.gain_schedule else ""
    loads = [(f"at {one.breakpoint:g} ", one.sway, one.filter) for one in config.gain_schedule]
    for name, sway, chosen in (*loads, (own, config.sway, config.filter)):
        assert sway is not None
        mode, percents = sway.mode(), tuple(usual_pct)
        if (design := chosen.design()) and (range_pct := design.length_range_pct):
            mode = SwayMode.from_period(design.period_s, design.damping_ratio)
            percents = -range_pct, range_pct
        middle_m, own_m = (GRAVITY_M_S2 / one.omega_rad_s**2 for one in (mode, sway.mode()))
        ends = [middle_m * (1.0 + percent / 100.0) for percent in percents]
        wrong = [100.0 * (m / own_m - 1.0) for m in ends]
        left = evaluate(*on_axis(deployment, axis, chosen, sway=sway), wrong).residuals
        short, long = (f"{100.0 * one.machine:.0f}" for one in left)
        yield f"{name}{ends[0]:.2f} to {ends[1]:.2f} m, {short} and {long} %"


def _load(deployment: "Deployment", bus: str) -> str:
    """Return the load of a bus by its messages, in words, with a warning above 50 %."""
    from canshaper.machine.buses import BUSY

    load = deployment.load(bus)
    if load is None:
        return ", no bitrate given, so its load is not known"
    config = deployment.config.buses[bus]
    rate = f"{(config.bitrate or 0) / 1000:g} kbit/s"
    if config.data_bitrate:
        rate += f", data {config.data_bitrate / 1000:g} kbit/s"
    warning = " - WARNING: above 50 %, frames will wait for others" if load.share > BUSY else ""
    return f", its {load.messages} messages load {load.share:.0%} of {rate}{warning}"
