"""A second, quicker swing in a log: hook and load of a simulated bridge crane, anti-sway off."""

import math
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.codec.frame import Frame
from canshaper.commissioning.identification.verdict import identify
from canshaper.design.lockstep import drive
from canshaper.machine.binding import load_deployment
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.strokes import Script, Stroke
from tests.commissioning.identification.machine import EMPTY
from tests.commissioning.identification.test_accuracy import NEAR_FAR, noisy, swung
from tests.rigs.overhead import FILE
from tests.sim.test_sling import modes


def log(path: Path, rope_m: float, sling_m: float, ratio: float) -> Path:
    """A drive of the bridge as candump writes it."""
    own = f"rope_m={rope_m} sling.length_m={sling_m} sling.load_ratio={ratio}".split()
    lines: list[str] = []

    def note(frame: Frame, time_s: float) -> None:
        lines.append(f"({1.7e9 + time_s:.6f}) can0 {frame.can_id:03X}#{frame.data.hex().upper()}")

    drive(
        load_deployment(FILE),
        Script("one", (Stroke("bridge", 1.0, 1.0, 1.0),), 60.0),
        on_frame=note,
        bypass=True,
        parameters=changed_parameters([f"overhead.{one}" for one in own]),
    )
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rope_m", "sling_m", "ratio", "about"),
    [(6.0, 2.0, 3.0, ()), (6.0, 4.0, 1.0, ("--about", "5.5")), (2.0, 4.0, 1.0, ("--about", "4.8"))],
)
def test_both_modes_of_hook_and_load(
    tmp_path: Path, rope_m: float, sling_m: float, ratio: float, about: tuple[str, ...]
) -> None:
    path = log(tmp_path / "hook.log", rope_m, sling_m, ratio)
    signal = ("--file", str(FILE), "--signal", "bridge=LoadSway.SwayBridge")
    done = CliRunner().invoke(app, ["identify", str(path), *signal, *about, "--out", str(tmp_path)])
    said = " ".join(done.output.split())
    assert done.exit_code == 0, said
    print(said)
    first_s, second_s = (2.0 * math.pi / omega for omega in modes(rope_m, sling_m, ratio))
    first, second = (re.search(p, said) for p in (r"period_s: ([\d.]+)", r"--second ([\d.]+),"))
    assert first and second
    assert float(first[1]) == pytest.approx(first_s, rel=0.005)
    assert float(second[1]) == pytest.approx(second_s, rel=0.01)


def test_one_swing_alone_has_no_second() -> None:
    time, angle = swung(EMPTY, 5.0, NEAR_FAR)
    finding = identify("near_far", "", [noisy(time, angle, 1, 0.15)])
    assert finding.usable
    assert not [note for note in finding.notes if "second" in note]
