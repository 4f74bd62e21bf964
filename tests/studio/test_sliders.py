"""Sliders as factors on numbers of the file, and the daemon's own view of them."""

import math
from pathlib import Path

import pytest

from canshaper.config.filters import Profile
from canshaper.controller.adjust import Adjuster
from canshaper.controller.controller import Controller
from canshaper.machine.binding import load_deployment
from canshaper.studio.crane import copied
from canshaper.studio.numbers import LENGTH, RANGES, adjustable, sliders, values
from tests.rigs.files import CONFIG, machine_file

FILES = sorted(path.name for path in CONFIG.glob("*.yaml") if "axes:" in path.read_text())


def test_length_is_that_of_the_pendulum() -> None:
    offered = sliders(load_deployment(CONFIG / "forwarder.yaml").config)
    after = values(offered, LENGTH, 2.0)
    assert after["axes.slew.sway.period_s"] == pytest.approx(2.356 * math.sqrt(2.0))
    assert after["axes.near_far.sway.length_m"] == pytest.approx(2.4)
    assert len(after) == 2


@pytest.mark.parametrize(
    ("name", "factor"),
    [("length", 2.1), ("length", 0.4), ("length", math.nan), ("length", 10**400), ("speed", 1.0)],
)
def test_what_is_no_position_of_a_slider_is_refused(name: str, factor: float) -> None:
    offered = sliders(load_deployment(CONFIG / "forwarder.yaml").config)
    with pytest.raises(ValueError, match="expected"):
        values(offered, name, factor)


@pytest.mark.parametrize("file", FILES)
def test_the_copy_of_every_shipped_file_is_a_deployment(file: str, tmp_path: Path) -> None:
    """Same machine, with the sliders' numbers adjustable and the DBC files found."""
    original = load_deployment(CONFIG / file)
    path, copy = copied(CONFIG / file, tmp_path)
    assert path.parent == tmp_path
    same = {"dbc": original.config.dbc, "control": original.config.control}
    assert copy.config.model_copy(update=same) == original.config
    numbers = adjustable(sliders(original.config))
    allowed = copy.config.control.adjustable if copy.config.control else {}
    assert numbers.items() <= allowed.items()


def test_a_control_section_of_the_file_is_kept(tmp_path: Path) -> None:
    control = "\ncontrol: { adjustable: { axes.slew.limits.max_pct: [50, 100] } }\n"
    file = machine_file(tmp_path, "forwarder", more=control)
    (tmp_path / "copy").mkdir()
    _, copy = copied(file, tmp_path / "copy")
    assert copy.config.control
    assert copy.config.control.adjustable["axes.slew.limits.max_pct"] == [50, 100]
    assert "axes.slew.sway.period_s" in copy.config.control.adjustable


@pytest.mark.parametrize("name", RANGES)
def test_the_daemon_takes_both_ends(name: str, tmp_path: Path) -> None:
    _, deployment = copied(CONFIG / "forwarder.yaml", tmp_path)
    adjuster = Adjuster(Controller(deployment))
    offered = sliders(deployment.config)
    for factor in (*RANGES[name], 1.0):
        numbers = values(offered, name, factor)
        adjuster.change(numbers)
        table = adjuster.table()
        assert {key: table[key]["now"] for key in numbers} == pytest.approx(numbers)


def test_an_axis_with_feels_has_no_sliders() -> None:
    """What is in force there changes with the machine, and the daemon refuses to adjust it."""
    config = load_deployment(CONFIG / "forwarder.yaml").config
    calm = Profile.model_validate({"filter": {"kind": "gff", "a1": 1.2, "a2": 0.3}})
    slew = config.axes["slew"].model_copy(update={"profiles": {"calm": calm}})
    config = config.model_copy(update={"axes": {**config.axes, "slew": slew}})
    keys = {number.key.split(".")[1] for numbers in sliders(config).values() for number in numbers}
    assert keys == {"near_far"}
