"""Constant tables as C source, exact to the last bit, and the sizes of what changes."""

import math
from typing import Any

from canshaper.native.tables import Numbers

TYPES = {
    "joystick": "cs_joystick_config",
    "valve": "cs_valve_config",
    "axis": "cs_axis_config",
    "motion": "cs_motion_config",
}
# Members that are pointers to arrays of their own.
APART = {
    "runs": "cs_run",
    "curve_command": "cs_real",
    "curve_speed": "cs_real",
    "codes": "cs_code",
}


def sizes_source(tables: Numbers) -> str:
    """Return ``cs_sizes.h``: how much room the state needs."""
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
    lines = [
        "/* Numbers of one machine. No line of this is code. */",
        "#include <math.h>",
        "",
        '#include "canshaper.h"',
        "",
        "#define R(x) ((cs_real)(x))",
        "",
    ]
    for name, kind in TYPES.items():
        for number, one in enumerate(tables[name]):
            lines += _apart(one, f"{name}_{number}")
        if tables[name]:
            rows = (f"    {_value(one, f'{name}_{k}')}" for k, one in enumerate(tables[name]))
            lines += [f"static const {kind} {name}s[] = {{", ",\n".join(rows), "};", ""]
    counts = "".join(f", .{name}s_n = {len(tables[name])}" for name in TYPES if name != "axis")
    arrays = "".join(f", .{name} = {name}s" for name in TYPES if tables[name])
    counts += f", .axes_n = {len(tables['axis'])}"
    lines.append(f"const cs_config cs_tables = {{.tick_ns = {tables['tick_ns']}{counts}{arrays}}};")
    return "\n".join(lines) + "\n"


def _apart(one: Any, name: str) -> list[str]:
    """Arrays that a struct points to."""
    lines: list[str] = []
    if isinstance(one, list):
        for k, value in enumerate(one):
            lines += _apart(value, f"{name}_{k}")
    elif isinstance(one, dict):
        for key, value in one.items():
            if key not in APART:
                lines += _apart(value, f"{name}_{key}")
            elif value:
                lines += [f"static const {APART[key]} {name}_{key}[] = {_value(value, name)};", ""]
    return lines


def _value(one: Any, name: str) -> str:
    """A number, struct or array as an initialiser; what is 0 is left out of a struct."""
    if isinstance(one, dict):
        members = []
        for key, value in one.items():
            if value not in (0, [], {}) or str(value) == "-0.0":
                text = f"{name}_{key}" if key in APART else _value(value, f"{name}_{key}")
                members.append(f".{key} = {text}")
        return f"{{{', '.join(members)}}}"
    if isinstance(one, list):
        return f"{{{', '.join(_value(value, f'{name}_{k}') for k, value in enumerate(one))}}}"
    if isinstance(one, bool):
        return "true" if one else "false"
    return real(one) if isinstance(one, float) else str(one)


def real(value: float) -> str:
    """A number of the C, exact; ``R`` makes it one of its precision."""
    if math.isinf(value):
        return "HUGE_VAL" if value > 0 else "-HUGE_VAL"
    return f"R({value.hex()})"
