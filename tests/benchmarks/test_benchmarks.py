"""The benchmarks keep up with what they measure: their options, and the deployments they make."""

import runpy
import sys
from importlib import import_module
from pathlib import Path

import pytest

from canshaper.config.bus import Bus
from canshaper.machine.binding import load_deployment
from canshaper.machine.stop_distance import unstated

ROOT = Path(__file__).parents[2]
PROGRAMS = sorted(
    path
    for path in (ROOT / "benchmarks").glob("*.py")
    if "ArgumentParser" in path.read_text()  # the others are started by these, or shared
)
BUS = Bus(interface="udp_multicast", channel="239.74.163.2")


@pytest.fixture(autouse=True)
def of_benchmarks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_help_says_what_is_measured(
    program: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", [str(program), "--help"])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(program), run_name="__main__")
    assert not ended.value.code
    assert capsys.readouterr().out.startswith("usage: ")


def test_the_deployments_they_make_are_valid(tmp_path: Path) -> None:
    kilohertz, rig, tick = (import_module(name) for name in ("kilohertz", "rig", "tick"))
    eight = load_deployment(kilohertz.deployment(tmp_path, 8, 2, BUS))
    assert (len(eight.axes), eight.config.tick_ms) == (8, 2)
    assert not [*unstated(eight)]  # the daemon would refuse it
    assert len(tick.four_axes(tmp_path).axes) == 4
    assert list(load_deployment(rig.slew_only(tmp_path, "vcan0", 1)).axes) == ["slew"]
    assert load_deployment(rig.on_channel(tmp_path, BUS)).config.buses["crane"] == BUS
