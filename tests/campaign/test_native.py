"""Drives in C: the rows of Python, or none."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from canshaper.campaign import measure, run
from canshaper.campaign.draw import draw_drive
from canshaper.campaign.measure import Row, measured_drive
from canshaper.campaign.native import SOURCES, NativeCrane
from canshaper.campaign.run import Source, drive_all, run_campaign
from canshaper.campaign.store import Store
from canshaper.config.desk import Uncertainty
from canshaper.design.parallel import Processes
from canshaper.errors import CampaignError, ConfigError, NativeError
from canshaper.machine.binding import load_deployment
from canshaper.native.library import FMU_FILES
from canshaper_sim.strokes import Script
from tests.cli.invocation import invoke
from tests.native.judge import needs_compiler
from tests.rigs.files import CONFIG, machine_file

ROBUST = load_deployment(CONFIG / "forwarder-robust.yaml")
FAULTY = Uncertainty(bus_fault_pct=100.0)


@pytest.fixture(autouse=True)
def _compiler() -> None:
    needs_compiler()


def same(one: Row, other: Row) -> bool:
    return {**one, "engine": ""} == {**other, "engine": ""}


def short(monkeypatch: pytest.MonkeyPatch, duration_s: float = 6.0) -> None:
    """Drives whose strokes end in 4 s."""

    def drawn(*arguments: object) -> object:
        setting = draw_drive(*arguments)  # type: ignore[arg-type]
        strokes = tuple(one for one in setting.script.strokes if one.end_s < 4.0)
        return replace(setting, script=Script("short", strokes, duration_s))

    monkeypatch.setattr(measure, "draw_drive", drawn)


@pytest.mark.parametrize(("seed", "ranges"), [(3, Uncertainty()), (3, FAULTY), (5, FAULTY)])
def test_a_row_of_c_is_that_of_python(
    seed: int, ranges: Uncertainty, monkeypatch: pytest.MonkeyPatch
) -> None:
    short(monkeypatch)
    row = measured_drive(ROBUST, seed, ranges, native=NativeCrane(ROBUST))
    assert (row["engine"], row["broken"]) == ("native", 0)
    assert same(row, measured_drive(ROBUST, seed, ranges))


def test_one_drive_in_fifty_is_driven_by_both(monkeypatch: pytest.MonkeyPatch) -> None:
    short(monkeypatch)
    row = measured_drive(ROBUST, 50, Uncertainty(), native=NativeCrane(ROBUST))
    assert (row["engine"], row["broken"]) == ("both", 0)


def test_the_first_drive_of_a_campaign_is_seen_by_the_gate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    short(monkeypatch)
    store = Store(tmp_path, {})
    source = Source.of(ROBUST, Uncertainty(), engine="native")
    run_campaign(Processes(1), source, range(1, 3), store, lambda _done: None)
    assert store.columns()["engine"] == ["both", "native"]


def test_a_radius_on_another_bus_is_measured_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    short(monkeypatch)
    bus = "radius: { bus: crane, message: TipPosition"
    second = "\nbuses:\n  second: { interface: virtual, channel: second }\n"
    changes = (bus, bus.replace("crane", "second")), ("\nbuses:\n", second)
    deployment = load_deployment(machine_file(tmp_path, ROBUST.path, *changes))
    row = measured_drive(deployment, 50, Uncertainty(), native=NativeCrane(deployment))
    assert row["residual_deg"] == measured_drive(ROBUST, 50, Uncertainty())["residual_deg"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["forwarder", "forwarder-robust", "forwarder-gff"])
@pytest.mark.parametrize("ranges", [Uncertainty(), FAULTY, Uncertainty(stops_pct=100.0)])
def test_many_rows_are_those_of_python(name: str, ranges: Uncertainty) -> None:
    deployment = load_deployment(CONFIG / f"{name}.yaml")
    native = NativeCrane(deployment)
    for seed in range(1, 30):
        row = measured_drive(deployment, seed, ranges, native=native)
        assert row["engine"] == "native"
        assert same(row, measured_drive(deployment, seed, ranges))


def planted(folder: Path, file: str, old: str, new: str) -> Path:
    """The C with a mistake."""
    shutil.copytree(SOURCES, sources := folder / "c")
    shutil.copy(FMU_FILES / "cs_number.h", sources)
    text = (sources / file).read_text(encoding="utf-8")
    assert text.count(old) == 1, old
    (sources / file).write_text(text.replace(old, new), encoding="utf-8")
    return sources


PLANTED = {
    "acceleration": ("cs_plant.c", "0.25 * ((((6.0", "0.25000000001 * ((((6.0"),
    "Coriolis": ("cs_plant.c", "2.0 * s6", "2.1 * s6"),
    "stroke": ("cs_plant.c", "release / one->ramp", "release / 0.2"),
    "code": ("cs_number.h", "rint(((value", "floor(((value"),
    "rest": ("cs_measure.c", "(fabs(joystick) <= 0.02)", "(fabs(joystick) <= 0.2)"),
    "dwell": ("cs_measure.c", "from + d->dwell_s", "from + 2.0 * d->dwell_s"),
    "travel": ("cs_measure.c", " - cs_sum_value(&asked)", ""),
    "dip": ("cs_measure.c", "- (held_most - held)", "+ 0 * (held_most - held)"),
    "crossing": ("cs_measure.c", "at += share", "at += 0 * share"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANTED)
def test_a_difference_is_refused_with_its_seed(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    short(monkeypatch, 10.0)
    native = NativeCrane(ROBUST, planted(tmp_path, *PLANTED[name]))
    with pytest.raises(CampaignError, match=r"drive \d+: expected the same"):
        for seed in (50, 100, 150, 200):
            measured_drive(ROBUST, seed, Uncertainty(), native=native)


@pytest.mark.slow
def test_other_mathematics_are_refused(tmp_path: Path) -> None:
    sources = planted(tmp_path, "cs_plant.c", "out[2] = exp(", "out[2] = expf(")
    with pytest.raises(NativeError, match="expected sin, cos and exp as Python's"):
        NativeCrane(ROBUST, sources)


def test_native_without_a_compiler_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run._native.cache_clear()  # of a machine that had one
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    arguments = ["campaign", str(ROBUST.path), "--engine", "native", "--out", str(tmp_path)]
    done = invoke(*arguments)
    assert done.exit_code == 2
    text = "expected a C compiler (cc, gcc, clang, or CC), got none; apt-get install gcc"
    assert done.output.splitlines() == [text]


@pytest.mark.parametrize("changes", [{"slope_deg": [2.0, 3.0]}, {"wind_m_s": [5.0, 6.0]}])
def test_a_drive_that_c_has_no_part_for_is_python_s(
    changes: dict[str, list[float]], monkeypatch: pytest.MonkeyPatch
) -> None:
    short(monkeypatch)
    ranges = Uncertainty(**changes)  # type: ignore[arg-type]
    row = measured_drive(ROBUST, 3, ranges, native=NativeCrane(ROBUST))
    assert row["engine"] == "python"


def test_a_deployment_that_c_has_no_part_for_is_python_s(monkeypatch: pytest.MonkeyPatch) -> None:
    short(monkeypatch)
    sensor = load_deployment(CONFIG / "forwarder-sensor.yaml")
    source = Source.of(sensor, Uncertainty(), engine="native")
    assert isinstance(source.native(), ConfigError)
    assert [row["engine"] for row in drive_all(source, (1,))] == ["python"]
