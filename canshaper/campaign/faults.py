"""What goes wrong in a drive of a campaign: joystick frames, or a sway sensor."""

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from canshaper.campaign.operators import Draw
from canshaper.codec.frame import Frame
from canshaper.design.lockstep import Joysticks


@dataclass(frozen=True)
class Fault:
    """One fault.

    Attributes:
        name: what it is; empty for none.
        disturb: stands between joysticks and bus.
        sensor: parameters of the sway sensors that are different.
    """

    name: str
    disturb: Callable[[Joysticks], Joysticks] | None = None
    sensor: dict[str, float] = field(default_factory=dict)


class _Disturbed:
    """Joysticks behind a bad bus for a part of the drive.

    Args:
        joysticks: those who hold them.
        kind: lost, late, garbled: what becomes of a frame.
        share: of the frames that it happens to.
        ms: from and to when.
        seed: of the choice.
    """

    def __init__(
        self, joysticks: Joysticks, kind: str, share: float, ms: tuple[float, float], seed: int
    ) -> None:
        self._joysticks, self._kind, self._share, self._ms = joysticks, kind, share, ms
        self._random = random.Random(seed)
        self._late: list[Frame] = []

    def frames_of_tick(self, time_ms: int, tick_ms: int) -> Sequence[Frame]:
        """Frames that came since the last tick, in order."""
        arrived, self._late = self._late, []
        for frame in self._joysticks.frames_of_tick(time_ms, tick_ms):
            hit = self._random.random() < self._share
            if not hit or not self._ms[0] <= time_ms < self._ms[1]:
                arrived.append(frame)
            elif self._kind == "late":
                self._late.append(frame)
            elif self._kind == "garbled":
                bit = self._random.randrange(8 * len(frame.data))
                value = int.from_bytes(frame.data, "little") ^ (1 << bit)
                data = value.to_bytes(len(frame.data), "little")
                arrived.append(frame._replace(data=data))
        return arrived


def bus_fault(draw: Draw, duration_s: float) -> Fault:
    """Joystick frames that are lost, late by a tick or with a wrong bit, or all of a while gone."""
    kind = draw.one_of(("silent", "lost", "late", "garbled"))
    share, begin_s = draw.between(0.02, 0.5), draw.between(0.0, 0.8 * duration_s)
    long_s, seed = draw.between(0.1, 0.5), int(draw.between(0.0, 2**31))
    if kind == "silent":
        share, end_s = 1.0, begin_s + 2.0 * long_s
    else:
        end_s = begin_s + long_s * duration_s
    ms = 1000.0 * begin_s, 1000.0 * end_s
    what = "lost" if kind == "silent" else kind
    return Fault(f"joystick {kind}", lambda joysticks: _Disturbed(joysticks, what, share, ms, seed))


def sensor_fault(draw: Draw, duration_s: float) -> Fault:
    """A sway sensor that fails at some time."""
    kind = draw.one_of(("lost", "stuck", "reversed", "jump"))
    return Fault(f"sensor {kind}", sensor={f"{kind}_s": draw.between(0.0, duration_s)})
