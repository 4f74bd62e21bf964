"""Logs of a crane whose swing is known: CAN logs and tables of a phone, with noise.

Those of docs/identification.md: ``python -m tests.commissioning.identification.machine DIRECTORY``.
"""

import math
import random
import struct
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper_sim.crane import Crane, CraneParameters, CraneState
from canshaper_sim.grapple import Grapple, Sway, SwayMode
from tests.rigs.files import ROOT

FILE = ROOT / "config" / "forwarder.yaml"
TICK_S = 0.02


class Push(NamedTuple):
    """A command of an axis, part of full."""

    axis: str
    start_s: float
    duration_s: float
    level: float


def period_of(mode: SwayMode) -> float:
    """Period of small damped swings, s."""
    return 2.0 * math.pi / (mode.omega_rad_s * math.sqrt(1.0 - mode.zeta**2))


def driven(
    seconds: float,
    pushes: Sequence[Push] = (),
    *,
    grapple: Grapple | None = None,
    sway: Sway | None = None,
    tick_s: float = TICK_S,
) -> list[tuple[CraneState, dict[str, float]]]:
    """States of the crane and the commands that led to each."""
    parameters = CraneParameters(grapple=grapple or Grapple())
    crane, drive = Crane(parameters, sway), []
    for tick in range(round(seconds / tick_s)):
        now = tick * tick_s
        commands = {"slew": 0.0, "near_far": 0.0, "lift": 0.0}
        for push in pushes:
            if push.start_s <= now < push.start_s + push.duration_s:
                commands[push.axis] = push.level
        crane.step(tick_s, commands)
        drive.append((crane.state, commands))
    return drive


class Coloured:
    """Noise of a first-order low-pass: neighbouring values are alike, as of a real sensor."""

    def __init__(self, seed: int, deviation: float, memory: float) -> None:
        self._random = random.Random(seed)
        self._deviation, self._memory = deviation, memory
        self._value = self._random.gauss(0.0, deviation)

    def __call__(self) -> float:
        new = math.sqrt(1.0 - self._memory**2) * self._random.gauss(0.0, self._deviation)
        self._value = self._memory * self._value + new
        return self._value


def candump(
    path: Path,
    drive: Sequence[tuple[CraneState, dict[str, float]]],
    *,
    seed: int = 0,
    noise_deg: float = 0.1,
    memory: float = 0.8,
    valves: bool = True,
    channel: str = "can0",
    epoch_s: float = 1.7e9,
    deployment: Deployment | None = None,
) -> Path:
    """Write a drive as candump does, with valve commands or without."""
    axes = (deployment or load_deployment(FILE)).axes
    noise = Coloured(seed, noise_deg, memory), Coloured(seed + 10_000, noise_deg, memory)
    lines, senders = [], {name: axis.valve.message.sender() for name, axis in axes.items()}
    for state, commands in drive:
        stamp = epoch_s + state.time_s
        if valves:
            for name, command in commands.items():
                valve, sender = axes[name].valve, senders[name]
                valve.put(sender.raw, round(command * valve.steps))
                frame = sender.frame()
                data = frame.data.hex().upper()
                lines.append(f"({stamp - TICK_S:.6f}) {channel} {frame.can_id:03X}#{data}")
        angles = math.degrees(state.theta5_rad), math.degrees(state.theta6_rad)
        raw = [round(100.0 * (a + n())) for a, n in zip(angles, noise, strict=True)]
        lines.append(f"({stamp:.6f}) {channel} 400#{struct.pack('<hh', *raw).hex().upper()}")
    path.write_text("\n".join(lines) + "\n")
    return path


def phone(
    path: Path,
    drive: Sequence[tuple[CraneState, dict[str, float]]],
    *,
    seed: int = 0,
    noise_rad_s: float = 0.005,
    turned_deg: float = 30.0,
    header: str = '"Time (s)","Gyroscope x (rad/s)","Gyroscope y (rad/s)","Gyroscope z (rad/s)"',
    row: str = "{t:.9f},{x:.6e},{y:.6e},{z:.6e}",
) -> Path:
    """Write what a phone on the grapple shows, turned about the cable by so much, with a bias."""
    noise = Coloured(seed, noise_rad_s, 0.2)
    turn = math.radians(turned_deg)
    lines = [header]
    for state, _ in drive:
        slew, near = state.theta5_rate_rad_s, state.theta6_rate_rad_s
        x = math.cos(turn) * slew - math.sin(turn) * near + 0.01 + noise()
        y = math.sin(turn) * slew + math.cos(turn) * near - 0.004 + noise()
        lines.append(row.format(t=state.time_s, x=x, y=y, z=state.theta1_rate_rad_s + noise()))
    path.write_text("\n".join(lines) + "\n")
    return path


EMPTY = Grapple()
LOADED = Grapple(l2_m=1.7, m2_kg=1200.0, c5_n_m_s_rad=400.0, c6_n_m_s_rad=400.0)
PUSHES = (Push("slew", 2.0, 1.0, 0.4), Push("near_far", 32.0, 0.7, 0.4))


def main(directory: Path) -> None:
    """Write the logs of docs/identification.md."""
    directory.mkdir(parents=True, exist_ok=True)
    for seed, (name, grapple) in enumerate((("empty", EMPTY), ("loaded", LOADED))):
        candump(directory / f"{name}.log", driven(60.0, PUSHES, grapple=grapple), seed=seed)
        for axis, mode in (("slew", grapple.mode5), ("near_far", grapple.mode6)):
            period, ratio = period_of(mode), mode.zeta
            print(f"{name}, {axis}: period {period:.4f} s, damping ratio {ratio:.4f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
