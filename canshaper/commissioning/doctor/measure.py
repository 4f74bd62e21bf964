"""One run of the loop with joysticks, and the times that it shows."""

import json
import socket
import subprocess
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Any

from canshaper.bus.packet import CAN_FRAME
from canshaper.commissioning.doctor.processes import Children, load_kinds, output, ready
from canshaper.errors import MeasurementError
from canshaper.machine.deployment import Deployment

# Time between two looks at the run, and how much longer than asked it may take.
LOOK_S = 0.2
PATIENCE_S = 120.0


@dataclass(frozen=True)
class Run:
    """Measurements of one run; times in ns.

    Attributes:
        late_ns: delay of each tick after its deadline; without the first, which sets the deadlines.
        valve_ns: from the start of each tick to its last valve frame, where it sent one.
        tick_ns: duration of each tick.
        joystick_ns: from each frame of a joystick to the next valve frame computed with it, for
            each axis of the joystick.
        missed: deadlines missed.
        events: changes of state (axis, new state, reason).
        moved: axes that were in motion.
        faults: counters of the status message that are not zero.
        policy: why the loop has no real-time priority, or None where it has.
        memory: why its memory is not locked, or None where it is.
    """

    late_ns: list[int]
    valve_ns: list[int]
    tick_ns: list[int]
    joystick_ns: list[int]
    missed: int
    events: list[tuple[str, str, str]]
    moved: list[str]
    faults: dict[str, int]
    policy: str | None
    memory: str | None


def measure(
    deployment: Deployment, seconds: float, on_progress: Callable[[float], None], *, load: bool
) -> Run:
    """Run the loop of a deployment without its buses.

    Args:
        deployment: what is run.
        seconds: how long it runs.
        on_progress: called with the seconds that have passed.
        load: keep the PC busy meanwhile.

    Raises:
        MeasurementError: a process failed, or did not end in time.
    """
    with Children() as children, ExitStack() as ends:
        loops, joysticks = {}, {}
        for name in deployment.config.buses:
            pair = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
            loops[name], joysticks[name] = pair
            for end in pair:
                ends.enter_context(end)
        file = str(deployment.path.resolve())
        hand = children.start("joysticks", {n: s.fileno() for n, s in joysticks.items()}, file=file)
        loop = children.start(
            "loop", {n: s.fileno() for n, s in loops.items()}, file=file, seconds=seconds
        )
        for process in (hand, loop):
            ready(process)
        for process in [children.start("processes", kind=kind) for kind in load_kinds() if load]:
            ready(process)
        for one in loops.values():
            one.send(
                bytes(CAN_FRAME.size)
            )  # the joysticks begin, and the loop with their first frame
        ends.close()  # the children see each other end
        record = _result(loop, hand, seconds, on_progress)
        return run_of(deployment, record, json.loads(output(hand, PATIENCE_S)))


def _result(
    loop: "subprocess.Popen[str]",
    hand: "subprocess.Popen[str]",
    seconds: float,
    on_progress: Callable[[float], None],
) -> dict[str, Any]:
    begin = time.monotonic()
    while (passed := time.monotonic() - begin) < seconds + PATIENCE_S:
        on_progress(passed)
        if hand.poll():  # they failed, and the loop would wait for them
            output(hand, PATIENCE_S)
        with suppress(subprocess.TimeoutExpired):
            result: dict[str, Any] = json.loads(output(loop, LOOK_S))
            return result
    raise MeasurementError(f"the loop did not end within {seconds + PATIENCE_S:.0f} s")


def run_of(
    deployment: Deployment, record: dict[str, Any], hand: dict[str, list[tuple[int, int]]]
) -> Run:
    """Return the run, out of the records of loop and joysticks.

    Args:
        deployment: what was run.
        record, hand: output of the processes of loop and joysticks.
    """
    began, ended = record["began_ns"], record["ended_ns"]
    sent = list(zip(*[iter(record["sent"])] * 3, strict=True))  # tick, axis, ns
    last = {tick: at_ns for tick, _, at_ns in sent}
    return Run(
        late_ns=record["late_ns"][1:],
        valve_ns=[at_ns - began[tick] for tick, at_ns in last.items()],
        tick_ns=[end - begin for begin, end in zip(began, ended, strict=True)],
        joystick_ns=_joystick_ns(deployment, record["received"], sent, hand),
        missed=record["missed"],
        events=[tuple(event) for event in record["events"]],
        moved=record["moved"],
        faults=record["faults"],
        policy=record["policy"],
        memory=record["memory"],
    )


def _joystick_ns(
    deployment: Deployment,
    received: list[int],
    sent: list[tuple[int, int, int]],
    hand: dict[str, list[tuple[int, int]]],
) -> list[int]:
    """Return the times from each joystick frame to the valve frames that are computed with it.

    Args:
        deployment: the machine.
        received: frames that the loop had taken from each bus by each tick, one tick after another.
        sent: (tick, number of the axis, time in ns) of each valve frame.
        hand: (number of the joystick, time in ns) of each joystick frame, by bus.

    A bus keeps the order of its frames: the n-th one that a joystick sent on it is the n-th that
    the loop took. Frames from before the first tick are too old, those after the last valve frame
    have no answer.
    """
    buses = list(deployment.config.buses)
    joysticks = list(deployment.config.joysticks)
    delays_ns: list[int] = []
    for number, axis in enumerate(deployment.axes.values()):
        joystick = axis.config.command.joystick
        bus = deployment.config.joysticks[joystick].bus
        counts = received[
            buses.index(bus) :: len(buses)
        ]  # frames received, up to and with each tick
        answers = [(tick, at_ns) for tick, valve, at_ns in sent if valve == number]
        i = 0
        for place, (which, at_ns) in enumerate(hand[bus]):
            while i < len(answers) and counts[answers[i][0]] <= place:
                i += 1
            if i == len(answers):
                break
            if which == joysticks.index(joystick) and place >= counts[0]:
                delays_ns.append(answers[i][1] - at_ns)
    return delays_ns
