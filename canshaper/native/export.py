"""``canshaper export``: the C of one machine, with a golden drive as its self-test."""

import hashlib
import math
import shutil
from dataclasses import dataclass, field
from pathlib import Path

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.errors import ConfigError, UsageError
from canshaper.machine.deployment import Deployment
from canshaper.machine.stopping import rehearsed_valves, unstated
from canshaper.native.drive import READ_NS, Tick, random_drive
from canshaper.native.library import C_FILES, FLAGS, NativeController, NativeLibrary
from canshaper.native.source import sizes_source, tables_source
from canshaper.native.states import axis_row, motion_row
from canshaper.native.tables import tables

TICKS, EVERY = 500, 25
# Of so many drives the one with the most states and reasons.
SEEDS = 12
PROBES = 16  # of atan2, which libraries round differently
LEFT_OUT = "status, identity and aim messages, feedback of the valves, numbers that may be changed"

MAKEFILE = """\
CC ?= cc
CFLAGS ?= -O2
ALWAYS = {flags}
C = $(wildcard src/*.c) $(wildcard test/*.c)

selftest: $(C) $(wildcard src/*.h) $(wildcard test/*.h)
\t$(CC) $(CFLAGS) $(ALWAYS) -Isrc -Itest -o $@ $(C) -lm
"""
CMAKE = """\
cmake_minimum_required(VERSION 3.13)
project(canshaper C)
file(GLOB SOURCES src/*.c)
file(GLOB TESTS test/*.c)
add_library(canshaper STATIC ${{SOURCES}})
target_include_directories(canshaper PUBLIC src)
target_compile_options(canshaper PUBLIC {flags})
target_link_libraries(canshaper PUBLIC m)
enable_testing()
add_executable(selftest ${{TESTS}})
target_link_libraries(selftest canshaper)
add_test(NAME selftest COMMAND selftest)
"""
README = """\
# Anti-sway of {name}, as C99

Written by `canshaper export {name}`; `src/canshaper.h` is the manual. Nothing here is edited by hand: the C is the same
for every machine, `src/cs_sizes.h` and `src/cs_tables.c` have its numbers.

    make && ./selftest

replays {ticks} ticks with {reasons} states and reasons: every valve frame, and every {every}th tick the inner state,
are compared with what {engine} has given here. Run it on the target too (`cs_selftest`, without `main.c`). Flags that
have to stay: `{flags}`.

{precision}

| axis | number | valve | message |
|---|---|---|---|
{axes}

Numbers of the buses: {buses}. Left out, as no valve frame hangs on them: {left_out}.

{identity}
"""


@dataclass
class Golden:
    """A drive with what came out of it.

    Attributes:
        ticks: the drive.
        sent: frames of the valves, by tick.
        rows: inner states after every ``EVERY``-th tick.
        seen: states with their reasons.
    """

    ticks: list[Tick] = field(default_factory=list)
    sent: list[list[Frame]] = field(default_factory=list)
    rows: list[list[float]] = field(default_factory=list)
    seen: set[tuple[str, int, int]] = field(default_factory=set)


def golden_drive(deployment: Deployment) -> Golden:
    """Return the drive of ``SEEDS`` that shows most of the controller, as the controller drives."""
    return max((_driven(deployment, str(k)) for k in range(SEEDS)), key=lambda one: len(one.seen))


def _driven(deployment: Deployment, seed: str) -> Golden:
    controller, golden = Controller(deployment.unreported), Golden()
    valves = list({runner.valve.key: None for runner in controller.axes.values()})
    for number, tick in enumerate(random_drive(deployment, seed, TICKS)):
        if tick.stalled:
            controller.stalled()
        if tick.failed is not None:
            controller.send_failed(Frame(*valves[tick.failed], b""))
        for frame in tick.frames:
            controller.receive(frame, tick.now_ns - READ_NS)
        golden.ticks.append(tick)
        golden.sent.append(list(controller.tick(tick.now_ns, tick.missed)))
        for name, runner in controller.axes.items():
            golden.seen.add((name, runner.axis.state, runner.axis.reason))
        if number % EVERY == 0:
            golden.rows += map(axis_row, controller.axes.values())
            golden.rows += map(motion_row, controller.motions)
    return golden


def _in_float(deployment: Deployment, golden: Golden) -> tuple[Golden, str]:
    """Return the same drive as the C computes it in float here, and what differs."""
    c = NativeController(NativeLibrary(deployment, "-DCS_FLOAT"))
    other = Golden(ticks=golden.ticks, seen=golden.seen)
    for number, tick in enumerate(golden.ticks):
        if tick.stalled:
            c.stalled()
        if tick.failed is not None:
            c.send_failed(tick.failed)
        for frame in tick.frames:
            c.receive(frame, tick.now_ns - READ_NS)
        other.sent.append(c.tick(tick.now_ns, tick.missed))
        if number % EVERY == 0:
            other.rows += c.rows()
    frames = [*zip(sum(golden.sent, []), sum(other.sent, []), strict=True)]
    differ = sum(one != two for one, two in frames)
    text = f"`float`: of {len(frames)} valve frames of this drive {differ} differ from `double`'s"
    return other, f"{text}, which are the controller's. The self-test compares with `float` here."


def export(deployment: Deployment, out: Path, *, single: bool) -> list[str]:
    """Write the export of a deployment into a folder.

    Args:
        deployment: the machine.
        out: a folder that is new or empty.
        single: in ``float``; it needs a C compiler here.

    Returns:
        What was written, for a person.

    Raises:
        ConfigError: the C has no part for something, or ``canshaper run`` would not begin.
        NativeError: ``single``, and the C cannot be compiled here.
        UsageError: the folder has files.
    """
    numbers = tables(deployment)
    faults = [*unstated(deployment), *rehearsed_valves(deployment.config)]
    if faults:
        raise ConfigError([deployment.source.problem(*one) for one in faults])
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise UsageError(f"--out: expected a new or empty folder, got {out}")
    golden, precision = golden_drive(deployment), "`double`: equal to the controller's to the last bit."
    if single:
        golden, precision = _in_float(deployment, golden)
    shutil.copytree(C_FILES, out / "src", ignore=shutil.ignore_patterns("test"))
    shutil.copytree(C_FILES / "test", out / "test")
    sizes = sizes_source(numbers) + ("#define CS_FLOAT\n" if single else "")
    flags = " ".join(FLAGS[:1] + FLAGS[2:])
    identity = "\n".join(f"    {one}" for one in [*deployment.identity.lines(), f"c=sha256:{_hash()}"])
    axes = (
        f"| {name} | {k} | {numbers['axis'][k]['valve']} | {one.valve_message.name} |"
        for k, (name, one) in enumerate(deployment.axes.items())
    )
    buses = ", ".join(f"{name} {k}" for k, name in enumerate(deployment.config.buses))
    readme = README.format(
        name=deployment.path.name,
        ticks=TICKS,
        every=EVERY,
        reasons=len({one[1:] for one in golden.seen}),
        engine="the C in float" if single else "the controller in Python",
        flags=flags,
        precision=precision,
        axes="\n".join(axes),
        buses=buses,
        left_out=LEFT_OUT,
        identity=identity,
    )
    files = {
        "src/cs_sizes.h": sizes,
        "src/cs_tables.c": tables_source(numbers),
        "test/cs_golden.c": _golden_source(deployment, golden, single=single),
        "Makefile": MAKEFILE.format(flags=flags),
        "CMakeLists.txt": CMAKE.format(flags=flags),
        "README.md": readme,
    }
    for name, text in files.items():
        (out / name).write_text(text, encoding="utf-8")
    return [f"{out}: {len(numbers['axis'])} axes", precision, f"make -C {out} && {out}/selftest"]


def _hash() -> str:
    """SHA-256 of the C that is the same for every machine."""
    total = hashlib.sha256()
    for path in sorted(C_FILES.rglob("*.[ch]")):
        total.update(f"{path.relative_to(C_FILES).as_posix()}\n".encode() + path.read_bytes())
    return total.hexdigest()


def _golden_source(deployment: Deployment, golden: Golden, *, single: bool) -> str:
    """Return ``cs_golden.c``: the drive, and what came out of it."""
    buses = list(deployment.config.buses)

    def frame(one: Frame) -> str:
        data = ", ".join(map(str, one.data)) or "0"
        extended = str(one.extended).lower()
        return f"{{{one.can_id}, {buses.index(one.bus)}, {len(one.data)}, {extended}, {{{data}}}}}"

    def tick(one: Tick, sent: list[Frame]) -> str:
        failed = -1 if one.failed is None else one.failed
        counts = f"{one.missed}, {len(one.frames)}, {len(sent)}, {failed}"
        return f"{{{one.now_ns}, {counts}, {str(one.stalled).lower()}}}"

    ticks = [tick(*one) for one in zip(golden.ticks, golden.sent, strict=True)]
    came = [frame(one) for tick in golden.ticks for one in tick.frames]
    sent = [frame(one) for frames in golden.sent for one in frames]
    rows = [", ".join(_real(x) for x in row) for row in golden.rows]
    probes = []
    for k in range(PROBES if deployment.motions and not single else 0):
        y, x = 0.37 * (k - 7.5), 1.0 + 0.61 * k
        probes.append(f"{{{y.hex()}, {x.hex()}, {math.atan2(y, x).hex()}}}")

    def array(kind: str, name: str, values: list[str], more: str = "") -> str:
        text = ",\n    ".join(values)
        return f"const {kind} cs_golden_{name}[]{more} = {{\n    {text}\n}};\n"

    return "\n".join(
        [
            '/* A golden drive. No line of this is code. */\n#include <math.h>\n\n#include "cs_selftest.h"\n',
            "#define R(x) ((cs_real)(x))\n",
            array("cs_golden_tick", "ticks", ticks),
            array("cs_frame", "in", came),
            array("cs_frame", "out", sent),
            array("cs_real", "rows", rows),
            array("cs_real", "atan2", probes or ["{0, 1, 0}"], "[3]"),
            f"const int32_t cs_golden_n = {len(ticks)};",
            f"const int32_t cs_golden_every = {EVERY};",
            f"const int32_t cs_golden_motion_n = {len(probes)};\n",
        ]
    )


def _real(value: float) -> str:
    if math.isinf(value):
        return "-HUGE_VAL" if value < 0 else "HUGE_VAL"
    return f"R({value.hex()})"
