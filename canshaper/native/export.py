"""``canshaper export``: the C of one machine, with a golden drive as its self-test."""

import hashlib
import json
import math
import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.errors import ConfigError, UsageError
from canshaper.machine.deployment import Deployment
from canshaper.machine.identity import program_sha256
from canshaper.machine.stop_distance import rehearsed_valves, unstated
from canshaper.native.drive import NAMES, Driven, Tick, play, random_drive, rows, valve_keys
from canshaper.native.library import (
    C_FILES,
    NativeController,
    NativeLibrary,
    real,
    sizes_source,
    tables_source,
)
from canshaper.native.tables import Numbers, tables
from canshaper.shipped import version

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
        rows: rows of inner state (``drive.rows``) after the first tick and each ``EVERY``-th then.
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
    """Return ``cs_golden.c``; ``single``: in float, without probes of atan2."""
    buses, valves = list(deployment.config.buses), valve_keys(deployment)

    def frame(one: Frame) -> str:
        bus, can_id, extended, data = one
        text = ", ".join(map(str, data)) or "0"
        return f"{{{can_id}, {buses.index(bus)}, {len(data)}, {str(extended).lower()}, {{{text}}}}}"

    def tick(one: Tick, sent: list[Frame]) -> str:
        failed = -1 if one.failed is None else valves.index(one.failed[:3])
        return f"{{{one.now_ns}, {one.missed}, {len(one.frames)}, {len(sent)}, {failed}}}"

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


FLAGS = "-std=c99 -ffp-contract=off"
LEFT_OUT = "status, identity and aim messages, feedback of the valves, numbers that may be changed"
MAKEFILE = f"""\
CC ?= cc
CFLAGS ?= -O2
C = $(wildcard src/*.c) $(wildcard test/*.c)

selftest: $(C) $(wildcard src/*.h) $(wildcard test/*.h)
\t$(CC) $(CFLAGS) {FLAGS} -Isrc -Itest -o $@ $(C) -lm
"""
CMAKE = f"""\
cmake_minimum_required(VERSION 3.13)
project(canshaper C)
file(GLOB SOURCES ${{CMAKE_CURRENT_SOURCE_DIR}}/src/*.c)
file(GLOB TESTS ${{CMAKE_CURRENT_SOURCE_DIR}}/test/*.c)
add_library(canshaper STATIC ${{SOURCES}})
target_include_directories(canshaper PUBLIC src)
target_compile_options(canshaper PUBLIC {FLAGS})
target_link_libraries(canshaper PUBLIC m)
enable_testing()
add_executable(selftest ${{TESTS}})
target_link_libraries(selftest canshaper)
add_test(NAME selftest COMMAND selftest)
"""
DOUBLE = "`double`: equal to the controller's, in Python, to the last bit."
README = """\
# {name} as C99

Written by `canshaper export`; `src/canshaper.h` is the manual. The C is the same for every machine,
`src/cs_sizes.h` and `src/cs_tables.c` have the numbers of this one.

    make && ./selftest

replays {ticks} ticks with {seen} states and reasons: every valve frame, and the inner state of
every {every}th tick, have to be those that were computed here. Run it on the target too
(`cs_selftest`, without `main.c`). These flags have to stay: `{flags}`.

{precision}

| axis | number | valve | message |
|---|---|---|---|
{axes}

Numbers of the buses: {buses}. Left out, as no valve frame hangs on them: {left_out}.

{identity}

`sbom.cdx.json` has the hash of every file.
"""


def export(deployment: Deployment, out: Path, *, single: bool) -> list[str]:
    """Write the export of a deployment into a folder.

    Args:
        deployment: the machine.
        out: a folder that is new or empty.
        single: export in ``float`` instead of ``double``; this needs a C compiler here.

    Returns:
        Lines for the user: its precision, and how to run the self-test.

    Raises:
        ConfigError: the C does not support something, or ``canshaper run`` would not start.
        NativeError: ``single``, and the C cannot be compiled here.
        UsageError: the folder has files.
    """
    numbers = tables(deployment)
    check_exported(deployment, out)
    golden, precision = golden_drive(deployment), DOUBLE
    if single:
        golden, differ = in_float(deployment, golden)
        frames = sum(map(len, golden.sent))
        precision = f"`float`: {differ} of {frames} valve frames of the golden drive differ from"
        precision += " those of `double`; the self-test has those of `float`."
    shutil.copytree(C_FILES, out, dirs_exist_ok=True)
    files = {
        "src/cs_sizes.h": sizes_source(numbers) + ("#define CS_FLOAT\n" if single else ""),
        "src/cs_tables.c": tables_source(numbers),
        "test/cs_golden.c": golden_source(deployment, golden, single=single),
        "Makefile": MAKEFILE,
        "CMakeLists.txt": CMAKE,
        "README.md": _readme(deployment, numbers, golden, precision),
    }
    for name, text in files.items():
        (out / name).write_text(text, encoding="utf-8")
    (out / "sbom.cdx.json").write_text(_bill(deployment, out), encoding="utf-8")
    return [precision.replace("`", ""), f"make -C {out} && {out}/selftest"]


def check_exported(deployment: Deployment, out: Path) -> None:
    """Check that a deployment may be exported into a folder.

    Raises:
        ConfigError: ``canshaper run`` would not start.
        UsageError: the folder has files.
    """
    faults = [*unstated(deployment), *rehearsed_valves(deployment.config)]
    if faults:
        raise ConfigError([deployment.source.problem(*one) for one in faults])
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise UsageError(f"--out: expected a new or empty folder, got {out}")


def _readme(deployment: Deployment, numbers: Numbers, golden: Golden, precision: str) -> str:
    axes = zip(deployment.axes.items(), numbers["axis"], strict=True)
    rows = [
        f"| {name} | {number} | {table['valve']} | {axis.valve_message.name} |"
        for number, ((name, axis), table) in enumerate(axes)
    ]
    return README.format(
        name=deployment.path.name,
        ticks=TICKS,
        every=EVERY,
        seen=len(golden.seen),
        flags=FLAGS,
        precision=precision,
        axes="\n".join(rows),
        buses=", ".join(f"{name} {k}" for k, name in enumerate(deployment.config.buses)),
        left_out=LEFT_OUT,
        identity="\n".join(f"    {line}" for line in deployment.identity.lines()),
    )


def _bill(deployment: Deployment, out: Path) -> str:
    """Return the bill of materials of a folder, CycloneDX 1.6: deployment, program, every file."""
    identity = deployment.identity
    made_of = {deployment.path.name: identity.deployment, **identity.dbc}
    for path in sorted(one for one in out.rglob("*") if one.is_file()):
        made_of[path.relative_to(out).as_posix()] = hashlib.sha256(path.read_bytes()).hexdigest()

    def component(kind: str, name: str, digest: str) -> dict[str, object]:
        return {"type": kind, "name": name, "hashes": [{"alg": "SHA-256", "content": digest}]}

    program = component("application", "canshaper", program_sha256()) | {"version": version()}
    about = {"component": {"type": "library", "name": f"{deployment.path.name} as C99"}}
    bill = {"bomFormat": "CycloneDX", "specVersion": "1.6", "version": 1, "metadata": about}
    components = [program, *(component("file", *one) for one in made_of.items())]
    return json.dumps({**bill, "components": components}, indent=1) + "\n"
