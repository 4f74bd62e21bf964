"""The CAN interfaces of a deployment, as the system set them up; nothing is opened or sent."""

import errno
import os
import socket
from collections.abc import Callable, Iterator

from canshaper.bus.apart import LOOK_S
from canshaper.bus.device import FD_MTU
from canshaper.bus.port import not_opened
from canshaper.bus.python_can import NEVER_BLOCK
from canshaper.commissioning.doctor.devices import Link, device_findings, read_link
from canshaper.commissioning.doctor.verdict import Finding, Level
from canshaper.config.bus import Bus

# Interfaces that hand out the error frames of their controller (python-can 4.6; by its source).
ERROR_FRAMES = frozenset(("etas", "gs_usb", "ixxat", "kvaser", "neovi", "nican", "nixnet", "pcan"))
ERROR_FRAMES |= {"serial", "socketcand", "usb2can", "vector"}


def adapter_findings(name: str, bus: Bus, tick_ms: int) -> Iterator[Finding]:
    """Yield what an interface of python-can can and cannot report.

    Args:
        name, bus: of the bus in the deployment file, and its section.
        tick_ms: period of the loop.
    """
    subject = f"bus {name} {bus.interface}"
    text = f"python-can on {bus.channel}: cannot be checked without opening it"
    yield Finding(subject, Level.NOTE, text)
    older_ms = tick_ms if bus.interface in NEVER_BLOCK else LOOK_S * 1000
    text = f"none that can be trusted: a frame counts as up to {older_ms:g} ms older than it is"
    remedy = f"give the timeout_ms of inputs {older_ms:g} ms more"
    yield Finding(f"{subject} time stamps", Level.NOTE, text, remedy)
    if bus.interface in ERROR_FRAMES:
        yield Finding(f"{subject} error frames", Level.OK, "handed out, and counted")
    else:
        text = "none: a disturbed bus is noticed when the frames of the joysticks stay away"
        yield Finding(f"{subject} error frames", Level.NOTE, text)
    text = "none: a frame that no node acknowledges counts as sent, so a cut line to a valve trips"
    remedy = "an adapter with a SocketCAN driver of its own, or feedback of the valve"
    yield Finding(f"{subject} send confirmation", Level.WARNING, f"{text} no axis", remedy)


# Lengths of the transmit queue, frames. The frames of one tick do not fit into a shorter one; a
# longer one sends commands that are long out of date (20 frames of 8 bytes: 13 ms at 250 kbit/s).
SHORTEST_QUEUE, LONGEST_QUEUE = 10, 20
ADAPTER = "an adapter with a driver of its own; slcan serves joysticks"
WRONG_RATE = "one of both is wrong: a wrong bit rate disturbs the whole bus"


def bus_findings(buses: dict[str, Bus], tick_ms: int) -> list[Finding]:
    """Check all buses of a deployment."""
    findings: list[Finding] = []
    kernel: OSError | None = None
    for name, bus in buses.items():
        if bus.interface != "socketcan":
            findings += adapter_findings(name, bus, tick_ms)
            continue
        kernel = kernel or kernel_fault()
        if kernel:
            remedy = "sudo modprobe can_raw; where there is no such module, another kernel"
            subject = f"bus {name}"
            text = str(not_opened(name, bus, kernel)).removeprefix(f"{subject}: ")
            findings.append(Finding(subject, Level.BAD, text, remedy))
        else:
            findings += link_findings(read_link(bus.channel), bus)
            findings += device_findings(name, bus)
    return findings


def kernel_fault() -> OSError | None:
    """Return the error of a kernel without SocketCAN; None of one that has it."""
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except OSError as error:
        return error
    return None


def link_findings(link: Link | None, bus: Bus) -> list[Finding]:
    """Check the interface of a bus as far as it shows itself; None is a missing one."""
    name = bus.channel
    if link is None:
        remedy = f"plug the adapter in; a virtual bus: sudo ip link add {name} type vcan"
        return [Finding(name, Level.BAD, os.strerror(errno.ENODEV), remedy)]
    if not link.can:
        remedy = "name a CAN interface in the deployment file"
        return [Finding(name, Level.BAD, "is no CAN interface", remedy)]
    if link.kind in ("vcan", "vxcan"):
        if link.up:
            text = "up; a virtual bus, nothing else to check"
            return [Finding(name, Level.NOTE, text), *fd(link, bus)]
        return [Finding(name, Level.BAD, "is down", f"sudo ip link set {name} up"), *fd(link, bus)]
    if not link.data:
        text = "no tool that shows bit rate, state and restart: not checked"
        tool = Finding(name, Level.WARNING, text, "install iproute2")
        return [up(link, bus), *fd(link, bus), queue(link), *echo(link, bus), tool]
    checks: list[Callable[[Link], Finding | None]] = [queue, state, errors, restart, modes]
    findings = [up(link, bus), bitrate(link, bus), *fd(link, bus), *echo(link, bus)]
    findings += [check(link) for check in checks]
    return [finding for finding in findings if finding]


def up(link: Link, bus: Bus) -> Finding:
    """Check that the interface is up."""
    if link.up:
        return Finding(link.name, Level.OK, "up")
    rate = link.rate() or bus.bitrate or 250_000
    options = f"bitrate {rate} {fd_options(bus)}{'restart-ms 100' * link.echo}".strip()
    remedy = f"sudo ip link set {link.name} up type can {options}"
    return Finding(link.name, Level.BAD, "is down", remedy)


def echo(link: Link, bus: Bus) -> list[Finding]:
    """Check that the driver confirms which frames got onto the bus; no finding where it does."""
    if link.echo:
        return []
    text = "none (no echo, as slcan): a cut line to a valve trips no axis; "
    text += "the file accepts that" if bus.unconfirmed else "run drives no valve by it"
    level = Level.WARNING if bus.unconfirmed else Level.BAD
    return [Finding(f"{link.name} send confirmation", level, text, ADAPTER)]


def bitrate(link: Link, bus: Bus) -> Finding | None:
    """Check the bit rate against that of the file, where both are known."""
    subject = f"{link.name} bit rate"
    if link.rate() is None:
        return None
    rate = f"{link.rate()} bit/s"
    if bus.bitrate is None or bus.bitrate == link.rate():
        return Finding(subject, Level.OK, rate)
    return Finding(subject, Level.BAD, f"{rate}, in the file {bus.bitrate} bit/s", WRONG_RATE)


def fd(link: Link, bus: Bus) -> list[Finding]:
    """Check that the interface carries CAN FD at the bit rate of the file, for a bus of CAN FD."""
    if not bus.fd:
        return []
    subject = f"{link.name} CAN FD"
    if link.mtu < FD_MTU:
        what = "mtu 72" if link.kind in ("vcan", "vxcan") else f"type can {fd_options(bus)}".strip()
        remedy = f"with {link.name} down: sudo ip link set {link.name} {what}"
        return [Finding(subject, Level.BAD, f"off, the MTU is {link.mtu}", remedy)]
    rate = link.rate("data_bittiming")
    if rate is None or rate == bus.data_bitrate:
        return [Finding(subject, Level.OK, f"on, data {rate} bit/s" if rate else "on")]
    expected = f"{bus.data_bitrate} bit/s" if bus.data_bitrate else "none"
    text = f"data {rate} bit/s, in the file data_bitrate {expected}"
    return [Finding(subject, Level.BAD if bus.data_bitrate else Level.WARNING, text, WRONG_RATE)]


def fd_options(bus: Bus) -> str:
    """Return the CAN FD options of ``ip link set ... type can``, with a blank behind them."""
    if not bus.fd:
        return ""
    return f"dbitrate {bus.data_bitrate or bus.bitrate or 2_000_000} fd on "


def queue(link: Link) -> Finding:
    """Check the transmit queue: a long one sends old commands, a short one has too little room."""
    subject = f"{link.name} queue"
    remedy = f"sudo ip link set {link.name} txqueuelen 16"
    queue = f"{link.queue} frames"
    if link.queue > LONGEST_QUEUE:
        text = f"{queue}: commands long out of date could go out after a blocked bus"
        return Finding(subject, Level.WARNING, text, remedy)
    if link.queue < SHORTEST_QUEUE:
        text = f"{queue}: the frames of a tick may not fit"
        return Finding(subject, Level.WARNING, text, remedy)
    return Finding(subject, Level.OK, queue)


def state(link: Link) -> Finding | None:
    """Check the state of the controller, which means nothing while the interface is down."""
    state = link.data.get("state")
    if state is None or not link.up:
        return None
    subject = f"{link.name} state"
    wires = "look at wiring, termination (60 ohm between the lines), bit rate of all nodes"
    if state == "ERROR-ACTIVE":
        return Finding(subject, Level.OK, "error-active, as it should be")
    if state == "ERROR-WARNING":
        return Finding(subject, Level.WARNING, "error-warning: many errors", wires)
    if state == "BUS-OFF":
        restarts = "type can restart" if link.echo else "down, then up"
        remedy = f"{wires}; then sudo ip link set {link.name} {restarts}"
        return Finding(subject, Level.BAD, "bus-off: the controller has left the bus", remedy)
    return Finding(subject, Level.BAD, state.lower(), wires)


def errors(link: Link) -> Finding | None:
    """Check the error counters of the controller, and its earlier faults."""
    if not link.up:
        return None
    counters = link.data.get("berr_counter", {})
    names = {"bus_off": "bus-off", "error_passive": "passive", "bus_error": "bus errors"}
    counted = [f"{n} {counters[n]}" for n in ("tx", "rx") if counters.get(n)]
    counted += [f"{text} {link.counts[n]}" for n, text in names.items() if link.counts.get(n)]
    subject = f"{link.name} errors"
    if not counted:
        return Finding(subject, Level.OK, "none counted")
    remedy = "wiring, termination, bit rates; some are counted since the adapter was plugged in"
    return Finding(subject, Level.WARNING, "counted: " + ", ".join(counted), remedy)


def restart(link: Link) -> Finding:
    """Check that the controller restarts by itself after bus-off."""
    subject = f"{link.name} restart"
    restart_ms = link.data.get("restart_ms", 0)
    if restart_ms:
        return Finding(subject, Level.OK, f"{restart_ms} ms after bus-off")
    if not link.echo:  # nor has such a driver a restart
        remedy = f"after bus-off: sudo ip link set {link.name} down, then up"
        return Finding(subject, Level.WARNING, "none by itself", remedy)
    text = "restart-ms 0: silent after bus-off until somebody restarts it"
    remedy = f"with {link.name} down: sudo ip link set {link.name} type can restart-ms 100"
    return Finding(subject, Level.WARNING, text, remedy)


def modes(link: Link) -> Finding:
    """Check that no mode is on that drops frames or floods the daemon with errors."""
    on = set(link.data.get("ctrlmode", []))
    subject = f"{link.name} modes"
    low = f"with {link.name} down: sudo ip link set {link.name} type can"
    if mute := on & {"LISTEN-ONLY", "LOOPBACK"}:
        options = " ".join(f"{mode.lower()} off" for mode in sorted(mute))
        text = ", ".join(sorted(mode.lower() for mode in mute))
        return Finding(subject, Level.BAD, f"{text}: no frame gets out", f"{low} {options}")
    if "ONE-SHOT" in on:
        text = "one-shot: a frame that loses the bus to another one is not sent again"
        return Finding(subject, Level.WARNING, text, f"{low} one-shot off")
    if "BERR-REPORTING" in on:
        text = "berr-reporting: a disturbed bus makes thousands of error frames a second"
        return Finding(subject, Level.WARNING, text, f"{low} berr-reporting off")
    return Finding(subject, Level.OK, "ordinary")
