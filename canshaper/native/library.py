"""The C with the tables of a deployment: as source, compiled and loaded on this machine.

Campaigns drive it, and tests compare it with the controller in Python; a crane does not need it. A
library whose arithmetic differs from Python's is refused when it is loaded.
"""

import ctypes
import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from hashlib import sha256
from pathlib import Path
from string import Template
from typing import Any

from canshaper.codec.frame import Frame
from canshaper.errors import NativeError
from canshaper.machine.deployment import Deployment
from canshaper.native.drive import NAMES, valve_keys
from canshaper.native.tables import Numbers, tables
from canshaper.shaping.state_machine import TABLE
from canshaper.shipped import PACKAGE

# Members that point to an array, and the type of its elements.
ARRAYS = {
    "joystick": "cs_joystick_config",
    "valve": "cs_valve_config",
    "axis": "cs_axis_config",
    "motion": "cs_motion_config",
    "runs": "cs_run",
    "curve_command": "cs_real",
    "curve_speed": "cs_real",
    "codes": "cs_code",
}
_TABLES = Template("""\
/* Numbers of one machine. No line of this is code. */
#include <math.h>

#include "canshaper.h"

#define R(x) ((cs_real)(x))
#if $wrong
#error cs_sizes.h is not of this machine
#endif

const cs_config cs_tables = $config;
const cs_row cs_rows[] = {
    $rows};
const int32_t cs_rows_n = $count;
""")


def _sizes(tables: Numbers) -> dict[str, int]:
    """Return the sizes of the arrays in the state."""
    axes = tables["axis"]
    return {
        "CS_JOYSTICKS": len(tables["joystick"]),
        "CS_NUMBERS": max(len(one["number"]) for one in tables["joystick"]),
        "CS_VALVES": len(tables["valve"]),
        "CS_AXES": len(axes),
        "CS_MOTIONS": max(1, len(tables["motion"])),
        "CS_TAPS": max(1, *(one.get("taps_n", 0) for one in axes)),
        "CS_WINDOW": max(one["tail"] for one in axes) + 1,
    }


def sizes_source(tables: Numbers) -> str:
    """Return ``cs_sizes.h``: the sizes of the arrays in the state."""
    rows = "".join(f"#define {name} {size}\n" for name, size in _sizes(tables).items())
    return f"/* Sizes of what changes, as cs_tables.c needs them. */\n{rows}"


def tables_source(tables: Numbers) -> str:
    """Return ``cs_tables.c``: the constant ``cs_tables``; it refuses sizes of another machine."""
    wrong = " || ".join(f"({name} != {size})" for name, size in _sizes(tables).items())
    plural = {"joystick": "joysticks", "valve": "valves", "axis": "axes", "motion": "motions"}
    counts = {f"{many}_n": len(tables[one]) for one, many in plural.items()}
    config, rows = _value(tables | counts), [*_rows()]
    joined = ",\n    ".join(rows)
    return _TABLES.substitute(wrong=wrong, config=config, rows=joined, count=len(rows))


def _rows() -> Iterator[str]:
    """Yield the rows of the state machine, which is the same in every machine."""
    for old, rows in TABLE.items():
        for when, new, why in rows:
            named, accepted = ("NONE", why) if isinstance(why, frozenset) else (why.name, ())
            causes = sum(1 << cause for cause in accepted)
            words = ", ".join(f"0x{causes >> at & 0xFFFFFFFF:08X}u" for at in (0, 32, 64))
            yield f"{{CS_{old.name}, 0x{when:03X}u, CS_{new.name}, CS_{named}, {{{words}}}}}"


def _value(one: Any, key: str = "") -> str:
    """Return a number, struct or array as an initialiser; a struct omits members that are 0."""
    if isinstance(one, dict):
        members = [
            f".{name} = {_value(value, name)}"
            for name, value in one.items()
            if value not in (0, [], {}) or str(value) == "-0.0"
        ]
        return f"{{{', '.join(members)}}}"
    if isinstance(one, list):
        kind = f"(const {ARRAYS[key]}[])" if key in ARRAYS else ""
        first, following = ("\n    ", ",\n    ") if isinstance(one[0], dict) else ("", ", ")
        return f"{kind}{{{first}{following.join(map(_value, one))}}}"
    if isinstance(one, bool):
        return "true" if one else "false"
    return real(one) if isinstance(one, float) else str(one)


def real(value: float) -> str:
    """Return a number as exact C; the macro ``R`` converts it to the precision of the build."""
    if math.isinf(value):
        return "HUGE_VAL" if value > 0 else "-HUGE_VAL"
    return f"R({value.hex()})"


C_FILES = PACKAGE / "native" / "c"
FMU_FILES = C_FILES.with_name("fmu")
# Equality to the last bit needs these: no -ffast-math, no contraction.
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-fast-math")
COMPILERS = ("cc", "gcc", "clang")
MOTION_ROW = 12


def compiler() -> list[str]:
    """Return the command of the C compiler: that of CC, or the first one of ``COMPILERS`` here.

    Raises:
        NativeError: there is none.
    """
    if named := os.environ.get("CC"):
        if shutil.which((command := named.split())[0]) is None:
            raise NativeError(f"CC: expected a C compiler, got {named!r}, which is not here")
        return command
    found = next(filter(None, map(shutil.which, COMPILERS)), None)
    if found is None:
        text = f"expected a C compiler ({', '.join(COMPILERS)}, or CC), got none"
        raise NativeError(f"{text}; apt-get install gcc")
    return [found]


def has_compiler() -> bool:
    """Return whether this machine has a C compiler."""
    try:
        return bool(compiler())
    except NativeError:
        return False


def build(numbers: Numbers, folder: Path, *more: str, sources: Path = C_FILES) -> Path:
    """Compile the C with these tables into a shared library.

    Args:
        numbers: see ``tables``.
        folder: folder for the library, and for the tables as source.
        more: more flags of the compiler, and more C files.
        sources: folder of the C.

    Raises:
        NativeError: there is no compiler, or it fails.
    """
    (folder / "cs_sizes.h").write_text(sizes_source(numbers), encoding="ascii")
    (folder / "cs_tables.c").write_text(tables_source(numbers), encoding="ascii")
    library = folder / "canshaper.so"
    files = [*sources.glob("src/*.c"), sources / "test/cs_inspect.c", folder / "cs_tables.c"]
    compile_library(files, library, *more, f"-I{folder}", f"-I{sources}/src")
    return library


def compile_library(files: Iterable[Path], library: Path, *more: str) -> None:
    """Compile C files into a shared library; ``more``: more flags of the compiler and C files.

    Raises:
        NativeError: there is no compiler, or it fails.
    """
    command = [*compiler(), *FLAGS, *more, "-shared", "-fPIC", *map(str, files)]
    done = subprocess.run(
        [*command, "-o", str(library), "-lm"], capture_output=True, text=True, check=False
    )
    if done.returncode:
        why = " ".join(done.stderr.split())[:500] or f"exit code {done.returncode}"
        raise NativeError(f"{command[0]} failed: {why}; CC may name another one")


def _content(numbers: Numbers, sources: Path, more: Iterable[str]) -> str:
    """Return the hash of everything that determines a library."""
    version = subprocess.run([*compiler(), "--version"], capture_output=True, check=False).stdout
    folders = [sources, *(Path(m[2:]) for m in more if m.startswith("-I"))]
    files = [file for folder in folders for file in sorted(folder.rglob("*.[ch]"))]
    text = f"{compiler()}{FLAGS}{more}{sizes_source(numbers)}{tables_source(numbers)}"
    parts = [version, text.encode(), *(path.read_bytes() for path in files)]
    return sha256(b"".join(sha256(part).digest() for part in parts)).hexdigest()


class _CFrame(ctypes.Structure):
    _fields_ = (
        ("id", ctypes.c_uint32),
        ("bus", ctypes.c_int32),
        ("length", ctypes.c_int32),
        ("extended", ctypes.c_bool),
        ("data", ctypes.c_uint8 * 8),
    )


class NativeLibrary:
    """The C with the tables of a deployment, compiled and loaded.

    Args:
        deployment: the machine.
        more: more flags of the compiler, and more C files.
        sources: folder of the C.
        cache: folder that keeps compiled libraries; None to compile every time.

    Raises:
        ConfigError: the C does not support something of the deployment.
        NativeError: the C cannot be compiled, or its arithmetic differs from Python's.
    """

    def __init__(
        self,
        deployment: Deployment,
        *more: str,
        sources: Path = C_FILES,
        cache: Path | None = None,
    ) -> None:
        numbers = tables(deployment)
        self.buses = list(deployment.config.buses)
        self.axes, self.motions = len(numbers["axis"]), len(numbers["motion"])
        self.valves = valve_keys(deployment)
        self.real = ctypes.c_float if "-DCS_FLOAT" in more else ctypes.c_double
        with tempfile.TemporaryDirectory(dir=cache) as folder:
            if cache is None:
                library = build(numbers, Path(folder), *more, sources=sources)
            else:
                library = cache / f"{_content(numbers, sources, more)}.so"
                if not library.exists():  # a second process would make the same
                    build(numbers, Path(folder), *more, sources=sources).replace(library)
            self.c = ctypes.CDLL(str(library))
        self.c.cs_arithmetic.restype = ctypes.c_bool
        if not self.c.cs_arithmetic():
            text = "expected arithmetic as Python's, got another one"
            raise NativeError(f"{text}: -ffast-math, contraction, x87, or another libm")


class NativeController:
    """The controller in C, with the part of ``Controller``'s interface that ``Driven`` names."""

    def __init__(self, library: NativeLibrary) -> None:
        self._c, self._buses = library.c, library.buses
        self._axes, self._motions, self._valves = library.axes, library.motions, library.valves
        self._tables = ctypes.byref(ctypes.c_char.in_dll(self._c, "cs_tables"))
        self._state = ctypes.create_string_buffer(self._c.cs_inspect_size())
        self._out = (_CFrame * len(library.valves))()
        self._row = (library.real * len(NAMES))()
        self._motion_row = (library.real * MOTION_ROW)()
        self._c.cs_init(self._state, self._tables)

    def receive(self, frame: Frame, arrived_ns: int) -> None:
        """Take a received frame."""
        bus, can_id, extended, data = frame
        length, at = len(data), ctypes.c_int64(arrived_ns)
        number = self._buses.index(bus)
        self._c.cs_receive(
            self._state, self._tables, number, can_id, ctypes.c_bool(extended), data, length, at
        )

    def tick(self, now_ns: int, missed: int = 0) -> list[Frame]:
        """Run every axis that is due after ``missed`` left-out ticks; return the valve frames."""
        now = ctypes.c_int64(now_ns)
        count = self._c.cs_tick(self._state, self._tables, now, missed, self._out)
        frames: Iterable[_CFrame] = self._out[:count]
        return [
            Frame(self._buses[f.bus], f.id, f.extended, bytes(f.data[: f.length])) for f in frames
        ]

    def stalled(self) -> None:
        """Do nothing: ``cs_tick`` finds by itself that the loop stood still."""

    def send_failed(self, frame: Frame) -> None:
        """Note that a valve frame could not be sent."""
        self._c.cs_send_failed(self._state, self._tables, self._valves.index(frame[:3]))

    def rows(self) -> list[list[float]]:
        """Return the inner state: a row for each axis, then for each motion; see ``drive.rows``."""
        rows = []
        for axis in range(self._axes):
            self._c.cs_inspect_axis(self._state, axis, self._row)
            rows.append(list(self._row))
        for motion in range(self._motions):
            self._c.cs_inspect_motion(self._state, motion, self._motion_row)
            rows.append(list(self._motion_row))
        return rows
