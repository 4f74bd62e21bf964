"""Hook and load on a simulated bridge crane: both modes, designed against by what the page says.

``pytest -s -m slow tests/closed_loop/test_sling.py`` prints what is left of both: off, and with a
reversal that stops or that lets the response end; degrees, hook against trolley.
"""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from canshaper.codec.frame import Frame
from canshaper.design.lockstep import drive
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper_sim.strokes import Script, Stroke
from tests.cli.invocation import invoke
from tests.rigs.overhead import FILE, changed
from tests.sim.test_sling import modes

ROPE_M, DAMPING, LOOK_S = 6.0, 0.005, 8.0
LENGTH = (
    "      length: { bus: crane, message: CranePosition, signal: RopeLength, timeout_ms: 200,"
    " lowest_m: 1.5, highest_m: 30 }\n"
)
DRIVES = {
    "pulse": (Stroke("bridge", 0.5, 6.0, 1.0),),
    "reversal": (Stroke("bridge", 0.5, 4.0, 1.0), Stroke("bridge", 4.5, 4.0, -1.0)),
    "tap": (Stroke("bridge", 0.5, 0.3, 1.0),),
}


def machine(directory: Path, sling_m: float, ratio: float) -> Path:
    """The bridge crane without a length signal, with hook and load, for its first mode."""
    first_s = 2.0 * math.pi / modes(ROPE_M, sling_m, ratio)[0]
    own = f"overhead.rope_m: {ROPE_M}, overhead.sling.length_m: {sling_m}"
    own += f", overhead.sling.load_ratio: {ratio}"
    return changed(
        directory,
        ("hoist: hoist }", f"hoist: hoist, simulated: {{ {own} }} }}"),
        (LENGTH, ""),
        ("length_m: 1.5\n", f"period_s: {first_s:.4f}\n"),
        ("designed_for: { period_s: 2.457", f"designed_for: {{ period_s: {first_s:.4f}"),
    )


def robust(file: Path, *words: str) -> tuple[int, str]:
    done = invoke("robust", file, "--axis", "bridge", "--range", "5", *words)
    return done.exit_code, " ".join(done.output.split())


def left_deg(
    deployment: Deployment, name: str, omegas: list[float], *, bypass: bool = False
) -> list[float]:
    """Swing left in each mode, degrees of the hook, when the tail is over."""
    strokes = DRIVES[name]
    end_s = max(one.end_s for one in strokes) + 7.0
    recording = drive(deployment, Script(name, strokes, end_s + LOOK_S), bypass=bypass)
    assert recording.axes["bridge"].sway_deg is not None
    time = np.array(recording.t_s)
    after = time >= end_s
    t, swing = time[after] - end_s, np.array(recording.axes["bridge"].sway_deg)[after]
    waves = [np.exp((1j - DAMPING) * omega * t) for omega in omegas]
    columns = [part for wave in waves for part in (wave.real, wave.imag)]
    best = np.linalg.lstsq(np.stack(columns, axis=1), swing, rcond=None)[0]
    return [math.hypot(*best[:2]), math.hypot(*best[2:])]


@pytest.mark.slow
@pytest.mark.parametrize(("sling_m", "ratio"), [(1.0, 1.0), (4.0, 1.0), (2.0, 3.0), (4.0, 10.0)])
def test_both_modes_are_left_in_peace_where_a_reversal_lets_the_response_end(
    tmp_path: Path, sling_m: float, ratio: float
) -> None:
    """A reversal that stops cuts the response; what makes good for it knows the first mode."""
    file, omegas = machine(tmp_path, sling_m, ratio), modes(ROPE_M, sling_m, ratio)
    first_s, second_s = (2.0 * math.pi / omega for omega in omegas)
    status, output = robust(file, "--second", f"{second_s:.4f},{DAMPING},20", "--write")
    assert status == 0
    limits = output[output.index("reversal: brake_shaped") :].split(" ")[:4]
    stops = load_deployment(file)
    file.write_text(
        file.read_text().replace("limits: { rise", f"limits: {{ {' '.join(limits)}, rise")
    )
    ends = load_deployment(file)
    raw, stopped, ended = (
        np.array([left_deg(one, name, omegas, bypass=off) for name in DRIVES])
        for one, off in ((stops, True), (stops, False), (ends, False))
    )
    print(f"\nsling {sling_m} m, ratio {ratio}, {first_s:.2f} and {second_s:.2f} s; degrees left")
    for name, *each in zip(DRIVES, raw, stopped, ended, strict=True):
        print(f"{name:9}", *(f"{one[0]:7.2f} {one[1]:6.3f}" for one in each))
    assert (ended <= 0.1 * raw).all()
    assert stopped[1, 1] > 3.0 * ended[1, 1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sling_m", "ratio", "about"), [(2.0, 3.0, ()), (4.0, 1.0, ("--about", "5.5"))]
)
def test_identify_finds_both_modes(
    tmp_path: Path, sling_m: float, ratio: float, about: tuple[str, ...]
) -> None:
    """In a log of a drive with anti-sway off, whose rope angle is sent to 0.01 degrees."""
    file, log = machine(tmp_path, sling_m, ratio), tmp_path / "hook.log"
    lines: list[str] = []

    def note(frame: Frame, time_s: float) -> None:
        lines.append(f"({1.7e9 + time_s:.6f}) can0 {frame.can_id:03X}#{frame.data.hex().upper()}")

    script = Script("one", (Stroke("bridge", 1.0, 1.0, 1.0),), 60.0)
    drive(load_deployment(file), script, on_frame=note, bypass=True)
    log.write_text("\n".join(lines) + "\n", encoding="utf-8")
    signal = ("--file", str(file), "--signal", "bridge=LoadSway.SwayBridge")
    done = invoke("identify", log, *signal, *about, "--out", tmp_path)
    said = " ".join(done.output.split())
    matches = [re.search(p, said) for p in (r"period_s: ([\d.]+)", r"--second ([\d.]+),")]
    periods_s = [float(one[1]) for one in matches if one]
    expected = [2.0 * math.pi / omega for omega in modes(ROPE_M, sling_m, ratio)]
    assert periods_s == pytest.approx(expected, rel=0.01), said


def test_a_second_mode_is_refused_with_a_rope_that_is_followed() -> None:
    says = "--second: expected an axis that follows no rope: its period does not go with the rope's"
    status, output = robust(FILE, "--second", "1.2,0.005,20")
    assert (status, output[: len(says)]) == (2, says)
