"""Cost of one tick of the daemon, next to a bare gateway of python-can and cantools.

Both take the same two joystick frames from a bus and send four valve frames to it; the bus is
python-can's ``virtual`` one, so that no kernel time is counted. The gateway only copies: receive,
decode, encode, send. The daemon's body also checks, shapes, limits, counts and publishes status; it
is timed with the gate in front of the bus, and without. What the black box adds is timed
without a bus: in the tick, behind it, and for the state that it keeps every ten seconds. So is what
the two-axis motion and its aim point add to forwarder-robust.yaml, with both joysticks moved all
the time; of the aim point, which is not sent in every tick, the mean.
Each is timed tick by tick, in turn, in one run, by processor time.

    python benchmarks/tick.py [--ticks 5000]
"""

import argparse
import gc
import statistics
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time_ns as clock

import can
from measure import Figure, publish

from canshaper.blackbox.recorder import Recorder
from canshaper.blackbox.ring import Ring
from canshaper.blackbox.state import States
from canshaper.bus.port import Port, open_port
from canshaper.codec.frame import Frame
from canshaper.config.bus import Bus
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shipped import data_directory
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import random_script
from canshaper_sim.plant import PlantNode
from canshaper_sim.strokes import Script, Stroke

FIGURES = (
    Figure("a tick, 4 axes, us", "bare loop of python-can + cantools"),
    Figure("a tick with the gate, us", "without"),
    Figure("a tick with the black box, no bus, us", "without"),
)
FOURTH_VALVE = """
BO_ 515 RotateCommand: 2 SHAPER
 SG_ Velocity : 0|8@1- (0.8,0) [-100|100] "%" VALVES
 SG_ AliveCounter : 8|8@1+ (1,0) [0|255] "" VALVES

CM_ "Example"""
FOURTH_AXIS = """  rotate:
    command: { joystick: right, signal: Rotate }
    valve:
      { bus: crane, message: RotateCommand, signal: Velocity, timeout_ms: 200,
        alive_counter: AliveCounter }
    sway: { period_s: 2.0, damping_ratio: 0.05, full_speed_m_s: 1.0 }
    filter: { kind: gff, a1: 0.708, a2: 0.12 }

status:"""


def four_axes(directory: Path) -> Deployment:
    """The shipped deployment with a fourth axis."""
    data = data_directory()
    dbc = (data / "dbc" / "forwarder.dbc").read_text()
    dbc = dbc.replace('\nCM_ "Example', FOURTH_VALVE)
    dbc = dbc.replace("BO_ 514 20;", 'BO_ 514 20;\nBA_ "GenMsgCycleTime" BO_ 515 20;')
    (directory / "four.dbc").write_text(dbc)
    text = (data / "config" / "forwarder.yaml").read_text()
    text = text.replace("../dbc/forwarder.dbc", "four.dbc").replace("status:", "STATUS:")
    text = text.replace("\nSTATUS:", "\n" + FOURTH_AXIS).replace("STATUS:", "status:")
    (directory / "four.yaml").write_text(text)
    return load_deployment(directory / "four.yaml")


def gateway(deployment: Deployment, bus: can.BusABC) -> Callable[[int], None]:
    """Bare recv, decode, encode, send."""
    joysticks = {
        joystick.message.frame_id: joystick.message for joystick in deployment.joysticks.values()
    }
    routes = [
        (a.config.command.signal, a.valve_message, a.config.valve.signal)
        for a in deployment.axes.values()
    ]
    values: dict[str, float] = {}
    count = 0

    def body(_now_ns: int) -> None:
        nonlocal count
        while (message := bus.recv(0)) is not None:
            decoded = joysticks[message.arbitration_id].decode(message.data, decode_choices=False)
            values.update(decoded)  # type: ignore[arg-type]
        count = (count + 1) % 256
        for joystick, valve, signal in routes:
            data = valve.encode({signal: values.get(joystick, 0.0), "AliveCounter": count})
            bus.send(can.Message(arbitration_id=valve.frame_id, is_extended_id=False, data=data))

    return body


def daemon(controller: Controller, port: Port, *, gated: bool) -> Callable[[int], None]:
    """Work of the daemon in a tick."""
    driven = GatedController(controller) if gated else controller

    def body(now_ns: int) -> None:
        for frame in port.frames():
            driven.receive(frame, now_ns)
        for frame in driven.tick(now_ns):
            port.send(frame)
        controller.events.clear()

    return body


def black_box(one: Deployment, other: Deployment, ticks: int) -> tuple[float, float]:
    """Median tick with the black box and without, us; print what it costs behind the tick."""
    controllers = Controller(one), Controller(other)
    guarded, inner = (GatedController(controller) for controller in controllers)
    ring, states = Ring(), States(inner, controllers[1])
    ring.begin(states.save(), 0, follows=False)
    recorder = Recorder(inner, controllers[1], ring)
    joysticks = JoystickNode(one, random_script(1, ticks * 0.02 + 1.0))
    without: list[int] = []
    recorded: list[int] = []
    behind: list[int] = []
    kept: list[int] = []
    both = (guarded, without), (recorder, recorded)
    gc.collect()
    gc.disable()  # as in the daemon
    for i in range(ticks):
        frames, now_ns = joysticks.frames(i * 20), i * 20_000_000
        for driven, spent in both[:: 1 if i % 2 else -1]:
            start = clock()
            for frame in frames:
                driven.receive(frame, now_ns)
            for _ in driven.tick(now_ns):
                pass
            spent.append(clock() - start)
        start = clock()
        recorder.flush()
        behind.append(clock() - start)
        for controller in controllers:
            controller.events.clear()
        if i % 50 == 0:
            start = clock()
            states.save()
            kept.append(clock() - start)
    bare, whole, after, state = (
        statistics.median(row) / 1e3 for row in (without, recorded, behind, kept)
    )
    print(
        f"black box: {whole - bare:.1f} us more in a tick,"
        f" {after:.1f} us behind it, {state:.0f} us for a state every 10 s"
    )
    return whole, bare


def two_axis_motion(ticks: int) -> None:
    """Measure and print what slew and near-far cost as one motion, and their aim point."""
    whole = load_deployment(data_directory() / "config" / "forwarder-robust.yaml")
    apart = whole.config.model_copy(update={"motion": {}})
    alone = replace(whole, config=apart, motions={})
    motions = {name: replace(one, aim=None) for name, one in whole.motions.items()}
    aimless = replace(whole, motions=motions)
    with_it, without = map(statistics.median, ticks_of_both(aimless, alone, ticks))
    print(f"two-axis motion: {with_it - without:.1f} us more in a tick of {without:.0f} us")
    with_it, without = map(statistics.mean, ticks_of_both(whole, aimless, ticks))
    more = with_it - without
    print(f"aim point: {more:.1f} us more in a tick of {without:.0f} us, {more / without:.1%}")


def ticks_of_both(
    deployment: Deployment, other: Deployment, ticks: int
) -> tuple[list[float], list[float]]:
    """Times of the ticks of two deployments of one crane, us; the first one drives it."""
    controllers = Controller(deployment), Controller(other)
    strokes = []
    for begin_s in range(0, int(ticks * 0.02), 8):
        for axis, level in (("slew", 1.0), ("near_far", 0.7)):
            strokes.append(Stroke(axis, begin_s + 0.1, 3.0, level))
            strokes.append(Stroke(axis, begin_s + 4.1, 3.0, -level))
    joysticks = JoystickNode(deployment, Script("both", tuple(strokes), ticks * 0.02 + 8.0))
    plant = PlantNode(deployment)
    spent: tuple[list[float], list[float]] = [], []
    both = tuple(zip(map(GatedController, controllers), spent, strict=True))
    measured: list[Frame] = []
    gc.collect()
    for i in range(ticks):
        frames, now_ns = [*measured, *joysticks.frames(i * 20)], i * 20_000_000
        sent: list[Frame] = []
        for driven, times in both[:: 1 if i % 2 else -1]:
            start = clock()
            for frame in frames:
                driven.receive(frame, now_ns)
            frames_of_tick = [*driven.tick(now_ns)]
            times.append((clock() - start) / 1e3)
            if times is spent[0]:
                sent = frames_of_tick
        for frame in sent:
            plant.receive(frame)
        for controller in controllers:
            controller.events.clear()
        plant.advance(0.02)
        measured = plant.feedback()
    return spent


def print_rows(ticks: int, spent: dict[str, list[int]]) -> None:
    """Print what a tick took."""
    print(f"{ticks} ticks, 2 joystick frames in, 4 axes (3 with G_FF, 1 off), us per tick")
    print(f"{'':34}{'median':>9}{'p99':>9}{'max':>9}")
    rows = (
        ("daemon body (bus, checks, status)", spent["ours"]),
        ("the same without the gate", spent["open"]),
        ("bare python-can + cantools loop", spent["bare"]),
    )
    for title, row in rows:
        p99 = statistics.quantiles(row, n=100)[98]
        print(f"{title:34}{statistics.median(row) / 1e3:9.1f}{p99 / 1e3:9.1f}{max(row) / 1e3:9.1f}")
    more = statistics.median(a - b for a, b in zip(spent["ours"], spent["open"], strict=True))
    print(f"gate: {more / 1e3:.1f} us more in the same tick")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ticks", type=int, default=5000)
    ticks = parser.parse_args().ticks
    with tempfile.TemporaryDirectory() as directory:
        deployment, other, *boxed = (four_axes(Path(directory)) for _ in range(4))
    controller = Controller(deployment)
    joysticks = JoystickNode(deployment, random_script(1, ticks * 0.02 + 1.0))
    hands = {n: can.Bus(interface="virtual", channel=n) for n in ("ours", "open", "bare")}
    port = open_port("crane", Bus(interface="virtual", channel="ours"), lambda _fault: None)
    ungated = open_port("crane", Bus(interface="virtual", channel="open"), lambda _fault: None)
    bare = can.Bus(interface="virtual", channel="bare")
    bodies = {
        "ours": daemon(controller, port, gated=True),
        "open": daemon(Controller(other), ungated, gated=False),
        "bare": gateway(deployment, bare),
    }
    spent: dict[str, list[int]] = {n: [] for n in bodies}
    for i in range(ticks):
        frames: list[Frame] = joysticks.frames(i * 20)
        # none is always behind the same
        for name, body in [*bodies.items()][:: 1 if i % 2 else -1]:
            for f in frames:
                hands[name].send(
                    can.Message(arbitration_id=f.can_id, is_extended_id=f.extended, data=f.data)
                )
            start = clock()
            body(i * 20_000_000)
            spent[name].append(clock() - start)
            while hands[name].recv(0) is not None:
                pass
    for bus in (*hands.values(), bare):
        bus.shutdown()
    port.close()
    ungated.close()

    print_rows(ticks, spent)
    ours, ungated_us, bare_us = (statistics.median(row) / 1e3 for row in spent.values())
    pairs = [(ours, bare_us), (ours, ungated_us)]
    box = black_box(*boxed, ticks)
    two_axis_motion(ticks)
    publish(FIGURES, [*pairs, box])


if __name__ == "__main__":
    main()
