"""Drives of a campaign in C: controller, valves, tip and grapple, equal to Python's to the bit.

Draws, joystick frames and measures are Python's. What the C has no part for is left to Python,
drive by drive; the gate is Python's too, so that only Python's drives say whether it refuses.
"""

import ctypes
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from canshaper.campaign.draw import Setting, driven_axes
from canshaper.codec.frame import Frame
from canshaper.design.lockstep import Joysticks
from canshaper.errors import ConfigError, NativeError
from canshaper.machine.deployment import Deployment
from canshaper.native.library import NativeLibrary
from canshaper_sim.axes import TIP_AXES
from canshaper_sim.crane import FULL_SPEEDS, INTERNAL_STEP_S, CraneParameters
from canshaper_sim.cranes import cranes
from canshaper_sim.grapple import Grapple
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.strokes import Script
from canshaper_sim.valve import ValveParameters
from canshaper_sim.valve_frames import CommandReader

PLANT = Path(__file__).with_name("c") / "cs_plant.c"
PROBES = 256  # of sine, cosine and exponential function, which libraries round differently
_FRAME = np.dtype(
    [("id", "u4"), ("bus", "i4"), ("length", "i4"), ("extended", "?"), ("data", "u1", 8)],
    align=True,
)
_VALVE = [
    "dead_time_s",
    "deadband",
    "negative_more_deadband",
    "hysteresis",
    "negative_gain",
    "flow_limit",
    "rate_limit_1_s",
    "lag_s",
]
_GRAPPLE = ("l1_m", "l2_m", "m1_kg", "m2_kg", "c5_n_m_s_rad", "c6_n_m_s_rad", "g_m_s2")
# Of what the C has no part for: as it is by default.
_ABSENT = ("boom", "contact", "log", "pump_flow", "ends")
_PLAIN = CraneParameters()
_UNCOMPENSATED = ("load", "load_per_t")


Packed = tuple[Any, Any]
"""How many joystick frames come in each tick, and the frames, as arrays."""


class _Valve(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_double) for name in (*_VALVE, "full_speed", "start", "low", "high")),
        *((name, ctypes.c_int32) for name in ("axis", "zero", "step", "full")),
    )


class _Drive(ctypes.Structure):
    _fields_ = (
        ("valve", _Valve * len(TIP_AXES)),
        ("sway", ctypes.c_double * 4),
        ("step_s", ctypes.c_double),
        ("tick_ms", ctypes.c_int64),
        *((name, ctypes.c_int32) for name in ("steps", "ticks", "loads", "radius")),
    )


class NativeCrane:
    """Controller and crane of a deployment in C.

    Args:
        deployment: the machine.
        plant: the C of the crane.
        keeps: what is compiled, for the next time.

    Raises:
        ConfigError: the C has no part for something of the deployment.
        NativeError: it cannot be compiled here, or its arithmetic is another one.
    """

    def __init__(self, deployment: Deployment, plant: Path = PLANT, *, keeps: bool = True) -> None:
        cache = _cache_folder() if keeps else None
        library = NativeLibrary(deployment, str(plant), cache=cache)
        self._c, self._deployment = library.c, deployment
        self._buses = library.buses
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

        # What the switch for anti-sway changes in the frames; nothing else there hangs on it.
        still = Script("still", (), 1.0)
        hands = [JoystickNode(deployment, still, bypass=off) for off in (False, True)]
        on, off = (self._packed(hand, 1)[1] for hand in hands)
        self._switch = {
            key: a ^ b for key, a, b in zip(on["id"], on["data"], off["data"], strict=True)
        }

    def has(self, setting: Setting) -> bool:
        """Whether the C has a part for all of the crane that was drawn."""
        parameters = setting.options["parameters"]
        return parameters is not None and is_simple(parameters)

    def frames(self, setting: Setting) -> Packed:
        """Joystick frames of a drive."""
        hands: Joysticks = JoystickNode(self._deployment, setting.script)
        if disturb := setting.options.get("disturb"):
            hands = disturb(hands)
        tick_ms = self._deployment.config.tick_ms
        return self._packed(hands, -(-round(setting.script.duration_s * 1000.0) // tick_ms))

    def switched_off(self, frames: Packed) -> Packed:
        """Return frames with anti-sway switched off; of joysticks that are not disturbed."""
        counts, array = frames
        array = array.copy()
        for key, bits in self._switch.items():
            array["data"][array["id"] == key] ^= bits
        return counts, array

    def drive(self, setting: Setting, packed: Packed) -> tuple[list[list[float]], list[float]]:
        """Drive a setting.

        Args:
            setting: what was drawn; see ``has``.
            packed: the joystick frames.

        Returns:
            Columns of theta1, radius, speeds, theta5, theta6 and commands, the three coordinates in
            the order of ``TIP_AXES``; and the times of the ticks that were driven, s. Fewer than
            drawn: it swung over.
        """
        options, tick_ms = setting.options, self._deployment.config.tick_ms
        parameters = options["parameters"]
        assert parameters
        counts, frames = packed
        ticks = len(counts)
        loads = [*options.get("loads", ())]
        drive = _Drive(
            **steps_of(tick_ms),
            tick_ms=tick_ms,
            ticks=ticks,
            loads=len(loads),
            radius=self._sends_radius,
            sway=(*(options.get("sway") or (0.0,) * 4),),
            valve=tuple(
                _Valve(**valve_numbers(parameters, axis), **wired)
                for axis, wired in zip(TIP_AXES, self._wiring, strict=True)
            ),
        )
        empty = np.array(grapple_numbers(parameters.grapple))
        loaded = np.array([[at, *grapple_numbers(one)] for at, one in loads])
        out = np.zeros((10, ticks))
        pointers = (array.ctypes.data_as(ctypes.c_void_p) for array in (empty, loaded))
        after = (array.ctypes.data_as(ctypes.c_void_p) for array in (counts, frames, out))
        driven = self._c.cs_drive(ctypes.byref(drive), *pointers, *after)
        return out[:, :driven].tolist(), [k * tick_ms / 1000.0 for k in range(driven)]

    def _packed(self, hands: Joysticks, ticks: int) -> Packed:
        """Joystick frames of some ticks."""
        tick_ms = self._deployment.config.tick_ms
        by_tick = [hands.frames_of_tick(k * tick_ms, tick_ms) for k in range(ticks)]
        flat: list[Frame] = [frame for frames in by_tick for frame in frames]
        array = np.zeros(max(1, len(flat)), _FRAME)
        if flat:
            buses, ids, extended, data = zip(*flat, strict=True)
            array["id"][:], array["extended"][:] = ids, extended
            array["bus"][:] = [self._buses.index(bus) for bus in buses]
            array["length"][:] = [*map(len, data)]
            joined = b"".join(one.ljust(8, b"\0") for one in data)
            array["data"][:] = np.frombuffer(joined, np.uint8).reshape(-1, 8)
        return np.array([*map(len, by_tick)], np.int32), array


def _cache_folder() -> Path:
    """Folder of what was compiled, for no one else to write into."""
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
    """Hold the functions of the C's mathematics library against Python's.

    Raises:
        NativeError: one is rounded otherwise.
    """
    out = (ctypes.c_double * 3)()
    for k in range(PROBES):
        x = 0.0123 * (k - PROBES / 2.5)
        c.cs_functions(ctypes.c_double(x), out)
        if [*out] != [math.sin(x), math.cos(x), math.exp(-abs(x))]:
            raise NativeError(f"expected sin, cos and exp as Python's, got others at {x}")


def _wiring(deployment: Deployment, axis: str | None) -> dict[str, int]:
    """Where the valve of an axis finds its command."""
    if axis is None:
        return {"axis": -1}
    reader = CommandReader(deployment, axis)
    number = [*deployment.axes].index(axis)
    return {"axis": number, "zero": reader.zero, "step": reader.step, "full": reader.full}


def steps_of(tick_ms: int) -> dict[str, Any]:
    """How a tick is divided for the crane."""
    steps = math.ceil(tick_ms / 1000.0 / INTERNAL_STEP_S - 1e-9)
    return {"step_s": tick_ms / 1000.0 / steps, "steps": steps}


def valve_numbers(parameters: CraneParameters, axis: str) -> dict[str, float]:
    """Return the valve of an axis, its full speed and its ends, in the order of the C."""
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
    """Return a grapple in the order of the C."""
    return [getattr(grapple, name) for name in _GRAPPLE]


def is_simple(p: CraneParameters) -> bool:
    """Whether the C has all that this crane does."""
    valves = [getattr(p, axis) for axis in TIP_AXES]
    compensated = not any(getattr(one, name) for one in valves for name in _UNCOMPENSATED)
    calm = p.carrier.level and not (p.wind.speed_m_s or p.wind.gust_m_s)
    return compensated and calm and all(getattr(p, n) == getattr(_PLAIN, n) for n in _ABSENT)
