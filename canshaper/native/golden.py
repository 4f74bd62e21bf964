"""The golden drive of an export: a drive and its expected frames and states, as C source."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.machine.deployment import Deployment
from canshaper.native.drive import Driven, Tick, play, random_drive, valve_keys
from canshaper.native.library import NativeController, NativeLibrary
from canshaper.native.source import real
from canshaper.native.states import NAMES, rows

TICKS, EVERY = 500, 25
# The golden drive is the one of so many with the most states and reasons.
SEEDS = 12
PROBES = 16  # of atan2: libraries round it differently
Row = list[float]


@dataclass
class Golden:
    """A drive with its frames and states.

    Attributes:
        ticks: the drive.
        sent: valve frames, by tick.
        rows: inner states after every ``EVERY``-th tick.
        seen: pairs of state and reason that an axis had.
    """

    ticks: list[Tick]
    sent: list[list[Frame]] = field(default_factory=list)
    rows: list[Row] = field(default_factory=list)
    seen: set[tuple[float, float]] = field(default_factory=set)


def golden_drive(deployment: Deployment) -> Golden:
    """Return the one of ``SEEDS`` drives that shows most states, with the controller's frames."""

    def driven(seed: int) -> Golden:
        controller = Controller(deployment.unreported)
        ticks = list(random_drive(deployment, str(seed), TICKS))
        return _driven(ticks, controller, lambda: rows(controller))

    return max(map(driven, range(SEEDS)), key=lambda one: len(one.seen))


def in_float(deployment: Deployment, golden: Golden) -> tuple[Golden, int]:
    """Return the same drive as the C computes it in float, and the number of frames that differ.

    Raises:
        NativeError: the C cannot be compiled here.
    """
    c = NativeController(NativeLibrary(deployment, "-DCS_FLOAT"))
    other = _driven(golden.ticks, c, c.rows)
    pairs = zip(golden.sent, other.sent, strict=True)
    return other, sum(a != b for one, two in pairs for a, b in zip(one, two, strict=True))


def _driven(ticks: list[Tick], controller: Driven, state: Callable[[], list[Row]]) -> Golden:
    golden = Golden(ticks)
    for number, tick in enumerate(ticks):
        golden.sent.append(play(tick, controller))
        now = state()
        golden.seen |= {(row[0], row[1]) for row in now if len(row) == len(NAMES)}
        golden.rows += [] if number % EVERY else now
    return golden


def golden_source(deployment: Deployment, golden: Golden, *, single: bool) -> str:
    """Return ``cs_golden.c``; ``single``: in float."""
    buses, valves = list(deployment.config.buses), valve_keys(deployment)

    def frame(one: Frame) -> str:
        bus, can_id, extended, data = one
        text = ", ".join(map(str, data)) or "0"
        return f"{{{can_id}, {buses.index(bus)}, {len(data)}, {str(extended).lower()}, {{{text}}}}}"

    def tick(one: Tick, sent: list[Frame]) -> str:
        failed = -1 if one.failed is None else valves.index(one.failed[:3])
        counts = f"{one.missed}, {len(one.frames)}, {len(sent)}, {failed}"
        return f"{{{one.now_ns}, {counts}, {str(one.stalled).lower()}}}"

    probes = []
    for k in range(PROBES if deployment.motions and not single else 0):
        y, x = 0.37 * (k - 7.5), 1.0 + 0.61 * k
        probes.append(f"{{{real(y)}, {real(x)}, {real(math.atan2(y, x))}}}")
    return "\n".join(
        [
            "/* A golden drive. No line of this is code. */",
            "#include <math.h>\n",
            '#include "cs_selftest.h"\n',
            "#define R(x) ((cs_real)(x))\n",
            _array("cs_golden_tick", "ticks[]", map(tick, golden.ticks, golden.sent)),
            _array("cs_frame", "in[]", (frame(f) for one in golden.ticks for f in one.frames)),
            _array("cs_frame", "out[]", (frame(f) for frames in golden.sent for f in frames)),
            _array("cs_real", "rows[]", (", ".join(map(real, row)) for row in golden.rows)),
            _array("cs_real", "atan2[][3]", probes or ["{0, 1, 0}"]),
            f"const int32_t cs_golden_n = {TICKS};",
            f"const int32_t cs_golden_every = {EVERY};",
            f"const int32_t cs_golden_atan2_n = {len(probes)};\n",
        ]
    )


def _array(kind: str, name: str, values: Iterable[str]) -> str:
    return f"const {kind} cs_golden_{name} = {{\n    {f',{chr(10)}    '.join(values)}\n}};\n"
