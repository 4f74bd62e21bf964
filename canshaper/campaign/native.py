"""Drives of a campaign in C: joysticks, controller, crane and measures, equal to those in Python.

Python draws each drive, and makes the frames that a bus fault disturbs. Python also drives what the
C does not support. The C has no gate: only a drive in Python shows whether the gate refuses.
"""

import ctypes
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from canshaper.campaign.draw import Setting, driven_axes
from canshaper.campaign.operators import Numbered
from canshaper.codec.layout import CLASSICAL_BYTES
from canshaper.design.lockstep import Joysticks
from canshaper.errors import ConfigError, NativeError
from canshaper.machine.deployment import Deployment
from canshaper.native.library import FMU_FILES, NativeLibrary
from canshaper_sim.axes import TIP_AXES
from canshaper_sim.crane import FULL_SPEEDS, INTERNAL_STEP_S, CraneParameters
from canshaper_sim.cranes import cranes
from canshaper_sim.grapple import Grapple
from canshaper_sim.hand import Hand
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.strokes import Script
from canshaper_sim.valve import ValveParameters
from canshaper_sim.valve_frames import CommandReader

SOURCES = Path(__file__).with_name("c")
QUICK = ("-O3", "-flto", "-fno-semantic-interposition")
PROBES = 256  # of sine, cosine and exponential function: libraries round them differently
_FRAME_BYTES = 12
_ARRIVAL = np.dtype([("number", "i4"), ("changed", "u1", CLASSICAL_BYTES)])
_VALVE = (
    *("dead_time_s", "deadband", "negative_more_deadband", "hysteresis"),
    *("negative_gain", "flow_limit", "rate_limit_1_s", "lag_s"),
)
_MEASURES = (
    *("still_s", "residual_deg", "peak_deg", "run_on_s", "run_on_m"),
    *("travel_error_s", "dip_pct"),
)
_COLUMNS = 13  # time series that the C measures
_GRAPPLE = ("l1_m", "l2_m", "m1_kg", "m2_kg", "c5_n_m_s_rad", "c6_n_m_s_rad", "g_m_s2")
# Parameters that the C does not support: they have to keep their defaults.
_ABSENT = ("boom", "contact", "log", "pump_flow", "ends")
_PLAIN = CraneParameters()
_UNCOMPENSATED = ("load", "load_per_t")


class _Valve(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_double) for name in (*_VALVE, "full_speed", "start", "low", "high")),
        ("nominal", ctypes.c_double),
        *((name, ctypes.c_int32) for name in ("axis", "zero", "step", "full")),
    )


class _Joystick(ctypes.Structure):
    _fields_ = (("cycle_ms", ctypes.c_int64), ("neutral", ctypes.c_uint8 * 8))


def _drive_type(joysticks: int) -> type[ctypes.Structure]:
    """Return the struct ``plant_drive`` for this number of joysticks."""

    class Drive(ctypes.Structure):
        _fields_ = (
            ("valve", _Valve * len(TIP_AXES)),
            ("joystick", _Joystick * joysticks),
            ("sway", ctypes.c_double * 4),
            *((name, ctypes.c_double) for name in ("step_s", "dwell_s", "still_deg")),
            ("tick_ms", ctypes.c_int64),
            *((name, ctypes.c_int32) for name in ("steps", "ticks", "loads", "strokes", "radius")),
        )

    return Drive


class NativeCrane:
    """Controller and crane of a deployment in C.

    Args:
        sources: folder of the C of crane and measures.
        keeps: store the compiled library for later processes.

    Raises:
        ConfigError: the C does not support something of the deployment.
        NativeError: the C cannot be compiled here, or its arithmetic differs from Python's.
    """

    def __init__(
        self, deployment: Deployment, sources: Path = SOURCES, *, keeps: bool = True
    ) -> None:
        files = (
            f"-I{sources}",
            f"-I{FMU_FILES}",
            f"{sources}/cs_plant.c",
            f"{sources}/cs_measure.c",
        )
        cache = _cache_folder() if keeps else None
        try:
            library = NativeLibrary(deployment, *QUICK, *files, cache=cache)
        except NativeError:  # the compiler has no link-time optimisation
            library = NativeLibrary(deployment, *files, cache=cache)
        self._c, self._deployment = library.c, deployment
        _check_functions(self._c)
        crane, moved = driven_axes(deployment)
        named = [*cranes(deployment)]
        problem = "" if named in ([], [crane]) else "several cranes"
        if {*deployment.coordinates.values()} - {*TIP_AXES} or {*moved} - {*TIP_AXES}:
            problem = "axes that do not move the tip directly"
        radii = [one.radius for one in deployment.motions.values() if one.radius]
        if any(one.protection.counter or one.message.name != "TipPosition" for one in radii):
            problem = "a radius that is not of TipPosition, or protected"
        if deployment.listen_only:
            problem = "listen_only"
        if problem:
            text = f"expected none in a campaign of C: {problem}"
            raise ConfigError([deployment.source.problem((), text)])
        self._sends_radius = bool(radii)
        axes = deployment.by_coordinate
        self._wiring = [_wiring(deployment, axes.get(one)) for one in TIP_AXES]

        still = Script("still", (), 1.0)
        self._cycles_ms = Hand(deployment).cycles_ms
        self._drive = _drive_type(len(self._cycles_ms))
        self._neutral = []  # anti-sway on, off
        for off in (False, True):
            first = JoystickNode(deployment, still, bypass=off).frames(0)
            pairs = zip(self._cycles_ms, first, strict=True)
            self._neutral.append(tuple((ms, tuple(one.data)) for ms, one in pairs))
        self._numbered = Numbered(JoystickNode(deployment, still))

    def has(self, setting: Setting) -> bool:
        """Return whether the C supports the drawn crane."""
        parameters = setting.options["parameters"]
        return parameters is not None and is_simple(parameters)

    def drive(
        self, setting: Setting, nominal: CraneParameters, *, bypass: bool = False
    ) -> tuple[dict[str, float | None], bool]:
        """Drive a setting and measure it.

        Args:
            setting: the drawn drive, which ``has`` accepts.
            nominal: the crane whose full speeds the operator expects of full deflection.
            bypass: drive with anti-sway off.

        Returns:
            The measures by name, None for a missing one, and whether the grapple swung over.
        """
        options, tick_ms = setting.options, self._deployment.config.tick_ms
        parameters, script = options["parameters"], setting.script
        assert parameters
        loads = [*options.get("loads", ())]
        strokes = [
            (start_s, past_s, one.duration_s, one.ramp_s, one.level, number)
            for number, axis in enumerate(self._deployment.axes)
            for start_s, past_s, one in script.of_axis(axis)
        ]
        ticks = -(-round(script.duration_s * 1000.0) // tick_ms)
        drive = self._drive(
            joystick=self._neutral[bypass],
            **steps_of(tick_ms),
            dwell_s=setting.dwell_s,
            still_deg=self._deployment.config.still_deg,
            tick_ms=tick_ms,
            ticks=ticks,
            loads=len(loads),
            strokes=len(strokes),
            radius=self._sends_radius,
            sway=(*(options.get("sway") or (0.0,) * 4),),
            valve=tuple(
                _Valve(
                    **valve_numbers(parameters, axis),
                    nominal=getattr(nominal, FULL_SPEEDS[axis]),
                    **wired,
                )
                for axis, wired in zip(TIP_AXES, self._wiring, strict=True)
            ),
        )
        arrivals: Sequence[Any] = (None, None)
        if disturb := options.get("disturb"):
            arrivals = self._arrivals(disturb(self._numbered), ticks)
        frames_n = sum(ticks * tick_ms // ms + 1 for ms in self._cycles_ms)
        empty = np.array(grapple_numbers(parameters.grapple))
        loaded = np.array([[at, *grapple_numbers(one)] for at, one in loads])
        made, columns = np.empty(frames_n * _FRAME_BYTES, np.uint8), np.empty((_COLUMNS, ticks))
        measures = np.zeros(len(_MEASURES) + 1)
        arrays = [empty, loaded, np.array(strokes), made, *arrivals, columns, measures]
        at = (None if one is None else one.ctypes.data_as(ctypes.c_void_p) for one in arrays)
        self._c.cs_drive(ctypes.byref(drive), *at)
        *values, swung_over = measures.tolist()
        named = zip(_MEASURES, values, strict=True)
        return {name: None if math.isnan(one) else one for name, one in named}, bool(swung_over)

    def _arrivals(self, hands: Joysticks, ticks: int) -> tuple[Any, Any]:
        """Return the number of joystick frames in each tick, and these frames, as arrays."""
        tick_ms = self._deployment.config.tick_ms
        by_tick = [hands.frames_of_tick(k * tick_ms, tick_ms) for k in range(ticks)]
        came = [frame for frames in by_tick for frame in frames]
        changed = b"".join([data.ljust(CLASSICAL_BYTES, b"\0") for *_, data in came])
        arrivals = np.empty(len(came), _ARRIVAL)
        arrivals["number"] = [number for _, number, *_ in came]
        arrivals["changed"] = np.frombuffer(changed, np.uint8).reshape(-1, CLASSICAL_BYTES)
        return np.array([*map(len, by_tick)], np.int32), arrivals


def _cache_folder() -> Path:
    """Return the folder of compiled libraries, into which no other user may write.

    Raises:
        NativeError: it cannot be made.
    """
    root = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(root) / "canshaper" / "native"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        folder.chmod(0o700)
    except OSError as error:
        text = f"expected a folder for what is compiled, got {error.strerror}; set XDG_CACHE_HOME"
        raise NativeError(f"{folder}: {text}") from None
    return folder


def _check_functions(c: Any) -> None:
    """Compare sin, cos and exp of the C's mathematics library with Python's.

    Raises:
        NativeError: one of them rounds differently.
    """
    out = (ctypes.c_double * 3)()
    for k in range(PROBES):
        x = 0.0123 * (k - PROBES / 2.5)
        c.cs_functions(ctypes.c_double(x), out)
        if [*out] != [math.sin(x), math.cos(x), math.exp(-abs(x))]:
            raise NativeError(f"expected sin, cos and exp as Python's, got others at {x}")


def _wiring(deployment: Deployment, axis: str | None) -> dict[str, int]:
    """Return where the simulated valve finds its command in the frames; axis -1 for none."""
    if axis is None:
        return {"axis": -1}
    reader = CommandReader(deployment, axis)
    number = [*deployment.axes].index(axis)
    return {"axis": number, "zero": reader.zero, "step": reader.step, "full": reader.full}


def steps_of(tick_ms: int) -> dict[str, Any]:
    """Return length, s, and number of the integration steps of a tick: step_s, steps."""
    steps = math.ceil(tick_ms / 1000.0 / INTERNAL_STEP_S - 1e-9)
    return {"step_s": tick_ms / 1000.0 / steps, "steps": steps}


def valve_numbers(parameters: CraneParameters, axis: str) -> dict[str, float]:
    """Return valve, full speed, start and end stops of an axis, in the order of the C."""
    number = TIP_AXES.index(axis)
    of = (("slew", "theta1_rad", "rad"), ("radius", "radius_m", "m"), ("height", "height_m", "m"))
    name, start, unit = of[number]
    valve: ValveParameters = getattr(parameters, axis)
    return {
        **{one: getattr(valve, one) for one in _VALVE},
        "full_speed": getattr(parameters, FULL_SPEEDS[axis]),
        "start": getattr(parameters, f"start_{start}"),
        "low": getattr(parameters, f"{name}_min_{unit}"),
        "high": getattr(parameters, f"{name}_max_{unit}"),
    }


def grapple_numbers(grapple: Grapple) -> Sequence[float]:
    """Return the parameters of a grapple in the order of the C."""
    return [getattr(grapple, name) for name in _GRAPPLE]


def is_simple(p: CraneParameters) -> bool:
    """Return whether the C supports every parameter of this crane."""
    valves = [getattr(p, axis) for axis in TIP_AXES]
    compensated = not any(getattr(one, name) for one in valves for name in _UNCOMPENSATED)
    calm = p.carrier.level and not (p.wind.speed_m_s or p.wind.gust_m_s)
    return compensated and calm and all(getattr(p, n) == getattr(_PLAIN, n) for n in _ABSENT)
