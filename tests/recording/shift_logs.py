"""Logs of work whose numbers are known: frames by cantools, figures by another way of counting."""

import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import cantools

from canshaper.cli.common import loader
from canshaper.recording.replay import look
from canshaper.recording.shift import LogOfWork, Shifts, first_ns
from tests.rigs.files import ROOT

TICK_S = 0.02
MONDAY_S = 1_790_000_000.0  # 2026-09-21 14:13:20
HOUR_S = 3600.0
FULL_M_S = {"slew": 1.5, "near_far": 1.0}
# Of config/forwarder.yaml: a stopwatch on slew; grapple data on near-far.
SWING = {
    "slew": (2.0 * math.pi / 2.356 / math.sqrt(1.0 - 0.038**2), 0.038),
    "near_far": (math.sqrt(9.81 / 1.2), 120.0 / (300.0 * 1.2**2) / (2.0 * math.sqrt(9.81 / 1.2))),
}
DEADBAND = 0.05
dbc: Any = cantools.database.load_file(ROOT / "dbc" / "forwarder.dbc")


class Part(NamedTuple):
    """Some seconds: joysticks and valves in %, of slew and near-far, and the state of both."""

    seconds: float
    joystick: tuple[float, float] = (0.0, 0.0)
    valve: tuple[float, float] = (0.0, 0.0)
    state: str | None = "ACTIVE"


# Out, a tap on the way, a tap back against one, and the way back: one cycle. Then with anti-sway
# off: near-far alone.
OUT = [Part(1.0), Part(3.0, (100, 0), (80, 0)), Part(4.0)]
TAPS = [Part(0.4, (-50, 0), (-48, 0)), Part(0.2), Part(0.4, (50, 0), (48, 0)), Part(5.0)]
BACK = [Part(3.0, (-100, 0), (-80, 0)), Part(6.0)]
SHORT = [Part(0.5), Part(0.5, (100, 0), (80, 0)), Part(0.2)]
CYCLE = [*OUT, *TAPS, *BACK]
OFF = [Part(2.0, (0, 100), (0, 60), "BYPASS_ON"), Part(6.0, state="READY")]


def lines(
    parts: Iterable[Part], begin_s: float = MONDAY_S, *, valves: bool = True, **switched: int
) -> Iterator[str]:
    """Yield the log of candump: joysticks, valves, a status ten times a second."""
    number = 0
    for part in parts:
        for _ in range(round(part.seconds / TICK_S)):
            time_s = begin_s + number * TICK_S
            counter = round((time_s - MONDAY_S) / TICK_S) % 256
            switches = {"Enable": 1, "AntiSwayOff": 0, "Reset": 0, "AliveCounter": counter}
            switches |= switched
            slew, near_far = part.joystick
            sent = {
                "JoystickLeft": {"Slew": slew, "NearFar": near_far, **switches},
                "JoystickRight": {"Lift": 0, "Rotate": 0, **switches, "AntiSwayOff": 0},
            }
            if valves:
                for name, velocity in zip(("Slew", "NearFar"), part.valve, strict=True):
                    sent[f"{name}Command"] = {"Velocity": velocity, "AliveCounter": counter}
                    if part.state and number % 5 == 0:
                        sent[f"{name}Status"] = dict.fromkeys(dbc_signals(f"{name}Status"), 0)
                        sent[f"{name}Status"]["State"] = part.state
            for name, values in sent.items():
                message = dbc.get_message_by_name(name)
                data = message.encode(values).hex().upper()
                yield f"({time_s:.6f}) vcan0 {message.frame_id:03X}#{data}\n"
            number += 1


def dbc_signals(message: str) -> list[str]:
    return [signal.name for signal in dbc.get_message_by_name(message).signals]


def written(path: Path, parts: Iterable[Part], begin_s: float = MONDAY_S, **options: Any) -> Path:
    """A log, or more of one."""
    with path.open("a", encoding="ascii") as log:
        log.writelines(lines(parts, begin_s, **options))
    return path


def tip_m_s(valve: float, axis: str) -> float:
    """Speed of the tip at a valve command in %."""
    part = abs(valve) / 100.0
    return (
        math.copysign((part - DEADBAND) / (1 - DEADBAND) if valve else 0.0, valve)
        * (FULL_M_S[axis])
    )


def swing_deg(parts: Sequence[Part]) -> list[float]:
    """Swing of the grapple at each tick, in small steps of the equation of the pendulum."""
    angle, rate = dict.fromkeys(FULL_M_S, 0.0), dict.fromkeys(FULL_M_S, 0.0)
    speed = dict.fromkeys(FULL_M_S, 0.0)
    total = []
    for part in parts:
        for _ in range(round(part.seconds / TICK_S)):
            for axis, valve in zip(FULL_M_S, part.valve, strict=True):
                omega, zeta = SWING[axis]
                step_m_s = tip_m_s(valve, axis) - speed[axis]
                speed[axis] += step_m_s
                rate[axis] += omega**2 / 9.81 * step_m_s
                for _ in range(50):
                    pull = -2.0 * zeta * omega * rate[axis] - omega**2 * angle[axis]
                    rate[axis] += pull * TICK_S / 50
                    angle[axis] += rate[axis] * TICK_S / 50
            total.append(math.degrees(math.hypot(*angle.values())))
    return total


def waited_s(parts: Sequence[Part], swing: Sequence[float], still_deg: float = 2.0) -> float:
    """Time from each release until the swing stays small, or to the next press."""
    moved = [any(p.joystick) for p in parts for _ in range(round(p.seconds / TICK_S))]
    total, at = 0.0, moved.index(True)
    while at < len(moved):
        if moved[at]:
            at += 1
            continue
        end = next((k for k in range(at, len(moved)) if moved[k]), len(moved))
        large = [k for k in range(at, end) if swing[k] >= still_deg]
        total += TICK_S * (large[-1] - at + 1 if large else 0)
        at = end
    return total


def counted(*logs: Path, file: str = "forwarder.yaml", by: str = "gap") -> tuple[Any, list[str]]:
    """Rows and notes of logs, in their order."""
    shifts, notes, deployment = Shifts(by, HOUR_S), [], loader(file)()
    for log in logs:
        drive = look(deployment, log, {}, own=False)
        opened = LogOfWork("", log.name, first_ns(drive), deployment, drive)
        notes += shifts.add(opened, lambda _part: None)
    return shifts.rows(), notes
