"""Constant tables as C source, exact to the last bit, and the sizes of the state."""

import math
from typing import Any

from canshaper.native.tables import Numbers

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
_TABLES = """\
/* Numbers of one machine. No line of this is code. */
#include <math.h>

#include "canshaper.h"

#define R(x) ((cs_real)(x))

const cs_config cs_tables = {};
"""


def sizes_source(tables: Numbers) -> str:
    """Return ``cs_sizes.h``: the sizes of the arrays in the state."""
    axes = tables["axis"]
    sizes = {
        "CS_JOYSTICKS": len(tables["joystick"]),
        "CS_NUMBERS": max(len(one["number"]) for one in tables["joystick"]),
        "CS_VALVES": len(tables["valve"]),
        "CS_AXES": len(axes),
        "CS_MOTIONS": max(1, len(tables["motion"])),
        "CS_TAPS": max(1, *(one.get("taps_n", 0) for one in axes)),
        "CS_WINDOW": max(one["tail"] for one in axes) + 1,
    }
    rows = "".join(f"#define {name} {size}\n" for name, size in sizes.items())
    return f"/* Sizes of what changes, as cs_tables.c needs them. */\n{rows}"


def tables_source(tables: Numbers) -> str:
    """Return ``cs_tables.c``: the constant ``cs_tables``."""
    plural = {"joystick": "joysticks", "valve": "valves", "axis": "axes", "motion": "motions"}
    counts = {f"{many}_n": len(tables[one]) for one, many in plural.items()}
    return _TABLES.replace("{}", _value(tables | counts))


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
