"""``canshaper export``: the C of one machine, with a golden drive as its self-test."""

import hashlib
import json
import shutil
from pathlib import Path

from canshaper.errors import ConfigError, UsageError
from canshaper.machine.deployment import Deployment
from canshaper.machine.identity import program_sha256
from canshaper.machine.stop_distance import rehearsed_valves, unstated
from canshaper.native.golden import EVERY, TICKS, Golden, golden_drive, golden_source, in_float
from canshaper.native.library import C_FILES
from canshaper.native.source import sizes_source, tables_source
from canshaper.native.tables import Numbers, tables
from canshaper.shipped import version

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
        single: in ``float``; it needs a C compiler here.

    Returns:
        What was written, for a person.

    Raises:
        ConfigError: the C has no part for something, or ``canshaper run`` would not begin.
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
    """Look whether a deployment may be exported into a folder.

    Raises:
        ConfigError: ``canshaper run`` would not begin.
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
    """Return the bill of a folder, CycloneDX 1.6: deployment, program, and every file of it."""
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
