"""A daemon on paper: the controller with a clock of its own, late ticks, and a bus that is logged.

Everything that makes it hard to read a log: frames that come while the daemon thinks, ticks that
are late or missing, clocks that drift apart.
"""

import math
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.daemon.standstill import Standstill
from canshaper.machine.deployment import Deployment
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import script_named

START_NS = 1_763_750_000_000_000_000


@dataclass
class Hardness:
    """What makes it hard.

    Attributes:
        think_ns: from reading to the valve frame, at most.
        late_ns: of a usual tick, at most.
        miss: how probable it is that a tick misses deadlines.
        joystick_phase_ns: when a joystick frame comes after the deadline of a tick.
        drift: of the joystick's clock against the daemon's.
        before_s: seconds that the joysticks run before the daemon starts.
        silent: from when to when after its start the joysticks send nothing, s.
        stands_s: when the loop stands still for a fifth of a second.
        reload: when its files are read again, and how long a bus takes to open then, s.
    """

    think_ns: int = 200_000
    late_ns: int = 100_000
    miss: float = 0.0
    joystick_phase_ns: int = 7_000_000
    drift: float = 0.0
    before_s: float = 1.0
    silent: tuple[float, float] = (0.0, 0.0)
    stands_s: float = math.inf
    reload: tuple[float, float] = (math.inf, 0.0)


def log_of(
    load: Callable[[], Deployment],
    seed: int,
    hardness: Hardness,
    *,
    seconds: float = 20.0,
    script: str | None = None,
) -> list[str]:
    """Lines of the log of such a daemon from its start to its stop."""
    chance = random.Random(seed)
    deployment = load()
    controller = Controller(deployment)
    tick_ns = deployment.config.tick_ms * 1_000_000
    standstill = Standstill(deployment)
    lines: list[tuple[int, int, str]] = []
    order = iter(range(10**9))

    def logged(time_ns: int, frame: Frame) -> None:
        seconds_, ns = divmod(time_ns + START_NS, 10**9)
        text = f"({seconds_}.{ns // 1000:06d}) {frame.bus} "
        can_id = f"{frame.can_id:08X}" if frame.extended else f"{frame.can_id:03X}"
        lines.append((time_ns // 1000, next(order), f"{text}{can_id}#{frame.data.hex().upper()}\n"))

    frames = _joysticks(load(), seed, chance, hardness, seconds=seconds, script=script)
    begin_ns = round(hardness.before_s * 1e9)
    for at_ns, frame in frames:
        logged(at_ns, frame)
    opened_ns = begin_ns - 15_000_000
    waiting = [f for f in frames if f[0] >= opened_ns]
    for number, frame in enumerate(controller.neutral_frames()):
        logged(begin_ns - 4_000_000 + 50_000 * number, frame)
    stands_s, (reload_s, opens_s) = hardness.stands_s, hardness.reload
    opens_ns = round(opens_s * 1e9)
    deadline = now = begin_ns
    end_ns = begin_ns + round(seconds * 1e9)
    while now < end_ns:
        late = now - deadline
        missed = max(0, late) // tick_ns
        deadline += missed * tick_ns
        if standstill.over(now):
            controller.stalled()
        for frame, arrived_ns in _read(deployment, waiting, now, standstill.last_ns):
            controller.receive(frame, arrived_ns)
        standstill.last_ns = now
        at_ns = now + chance.randrange(20_000, 20_001 + hardness.think_ns)
        for frame in controller.tick(now, missed):
            logged(at_ns, frame)
            at_ns += chance.randrange(20_000, 60_000)
        deadline += tick_ns
        now = deadline + chance.randrange(5_000, 5_001 + hardness.late_ns)
        if chance.random() < hardness.miss:
            now += chance.randrange(tick_ns * 3)
        if (now - begin_ns) / 1e9 > stands_s:
            stands_s = math.inf
            now += 200_000_000
        now = max(now, at_ns)
        if (now - begin_ns) / 1e9 > reload_s and controller.neutral:
            reload_s = math.inf
            for number, frame in enumerate(controller.neutral_frames()):
                logged(at_ns + 50_000 * number, frame)
            before, controller = controller, Controller(load())
            controller.carry_over(before)
            now = deadline = at_ns + 500_000 + opens_ns
    for number, frame in enumerate(controller.neutral_frames()):
        logged(at_ns + 50_000 * number, frame)
    return [line for _, _, line in sorted(lines)]


def _read(
    deployment: Deployment, waiting: list[tuple[int, Frame]], now_ns: int, before_ns: int
) -> Iterator[tuple[Frame, int]]:
    """What a tick reads of what waits, with its arrival: stamped, or at the read before."""
    while waiting and waiting[0][0] <= now_ns:
        at_ns, frame = waiting.pop(0)
        stamped = deployment.config.buses[frame.bus].interface == "socketcan"
        yield frame, at_ns if stamped else min(before_ns, now_ns)


def _joysticks(
    deployment: Deployment,
    seed: int,
    chance: random.Random,
    hardness: Hardness,
    *,
    seconds: float,
    script: str | None,
) -> list[tuple[int, Frame]]:
    """What the joysticks send, and when."""
    joysticks = JoystickNode(
        deployment, script_named(script or f"random-{seed}", list(deployment.axes))
    )
    frames: list[tuple[int, Frame]] = []
    for number in range(round((seconds + hardness.before_s) * 1000 / joysticks.cycle_ms)):
        at_ns = round(number * joysticks.cycle_ms * 1e6 * (1 + hardness.drift))
        at_ns += hardness.joystick_phase_ns + chance.randrange(50_000)
        quiet = hardness.silent[0] <= at_ns / 1e9 - hardness.before_s < hardness.silent[1]
        for frame in joysticks.frames(number * joysticks.cycle_ms):
            at_ns += 60_000
            if not quiet:
                frames.append((at_ns, frame))
    return frames
