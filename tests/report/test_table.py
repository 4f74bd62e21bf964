import io
from dataclasses import replace
from typing import Any

import pytest
from rich.console import Console

from canshaper.report.console import print_report
from canshaper.report.metrics import report_dict
from canshaper_sim.recording import CraneTrace, Recording


def printed(report: dict[str, Any], *, encoding: str = "utf-8") -> str:
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    print_report(report, Console(file=stream, width=80, color_system=None))
    stream.flush()
    stream.seek(0)
    return stream.read()


@pytest.fixture
def report(pair: tuple[Recording, Recording]) -> dict[str, Any]:
    return report_dict(*pair, transport="udp_multicast", missed_deadlines=0)


def test_table_reports_every_number_within_80_columns(report: dict[str, Any]) -> None:
    text = printed(report)
    assert max(map(len, text.splitlines())) <= 80
    assert "…" not in text
    for name in ("near_far", "slew"):
        axis = report["axes"][name]
        raw, shaped = axis["raw"], axis["shaped"]
        for measure in ("peak", "rms", "residual"):
            assert f"{raw[measure + '_deg']:.1f} → {shaped[measure + '_deg']:.1f}" in text
            assert f"-{axis[measure + '_reduction_pct']:.0f} %" in text
        for measure in ("time_to_95_s", "run_on_s"):
            assert f"{raw[measure]:.2f} → {shaped[measure]:.2f}" in text
        for measure in ("dip", "re_rise"):
            assert f"0 → {100 * shaped[measure]:.0f}" in text
    for heading in (
        "peak sway",
        "RMS sway",
        "residual",
        "time to 95 %",
        "run-on",
        "dip",
        "re-rise",
    ):
        assert heading in text


def test_lift_shows_dashes_for_sway_and_its_times(report: dict[str, Any]) -> None:
    lines = printed(report).splitlines()
    axes = list(report["axes"])
    assert axes[-1] == "lift"
    for row in ("peak sway", "RMS sway", "residual sway"):
        assert next(line for line in lines if row in line).split()[-1] == "-"
    assert "0.3" in next(line for line in lines if "time to 95" in line).split()[-1]


def test_swing_in_the_other_plane_is_reported_where_there_is_some(report: dict[str, Any]) -> None:
    text = printed(report)
    assert "After slew, residual sway in the other plane" in text
    assert "After near-far" not in text


@pytest.mark.parametrize(
    ("raw_deg", "shaped_deg", "with_filters"),
    [(91.0, 20.0, "off"), (91.0, 95.0, "off and filters on"), (89.0, 20.0, "")],
)
def test_a_grapple_above_the_horizontal_is_reported(
    pair: tuple[Recording, Recording], raw_deg: float, shaped_deg: float, with_filters: str
) -> None:
    drives = []
    for drive, sway_deg in zip(pair, (raw_deg, shaped_deg), strict=True):
        count = len(drive.t_s)
        way = [(3.0, 0.0)] * count
        drives.append(replace(drive, crane=CraneTrace(way, way, [sway_deg] * count)))
    report = report_dict(*drives, transport="udp_multicast", missed_deadlines=0)
    text = " ".join(printed(report).split())
    line = f"above the horizontal with filters {with_filters}: these figures say nothing"
    assert (line in text) == bool(with_filters)
    if raw_deg > 90.0:  # a part of nothing that a crane does, so no part is given
        assert text.startswith("The grapple swung above the horizontal")
        assert "%" not in text.replace("after press, %", "").replace("re-rise, %", "").replace(
            "to 95 %", ""
        )
        parts = [report["crane"], *report["axes"].values()]
        assert {v for one in parts for k, v in one.items() if k.endswith("_pct")} == {None}
    else:
        assert report["crane"]["peak_reduction_pct"] is not None


def test_missed_deadlines_and_transport(report: dict[str, Any]) -> None:
    text = printed(report)
    assert "Missed deadlines: 0" in text
    assert "udp_multicast" in text
    assert "busy" not in text
    assert "Missed deadlines: -" in printed(report | {"missed_deadlines": None})
    assert "A busy machine disturbed" in printed(report | {"missed_deadlines": 3})


def test_a_worse_swing_reads_as_an_increase(report: dict[str, Any]) -> None:
    report["axes"]["slew"]["residual_reduction_pct"] = -12.4
    assert "+12 %" in printed(report)


def test_a_measure_of_one_drive_only(report: dict[str, Any]) -> None:
    slew = report["axes"]["slew"]
    slew["shaped"]["residual_deg"] = slew["residual_reduction_pct"] = None
    slew["shaped"]["time_to_95_s"] = None
    text = printed(report)
    assert f"{slew['raw']['residual_deg']:.1f} → -" in text
    assert f"{slew['raw']['time_to_95_s']:.2f} → -" in text


def test_a_terminal_without_unicode(report: dict[str, Any]) -> None:
    assert "->" in printed(report, encoding="ascii")


@pytest.mark.parametrize(
    ("reduction", "expected"),
    [(99.4, "-99 %"), (99.6, "-99.6 %"), (99.97, "-99.9 %"), (100.0, "-100 %")],
)
def test_nearly_all_is_not_all(report: dict[str, Any], reduction: float, expected: str) -> None:
    report["axes"]["slew"]["residual_reduction_pct"] = reduction
    assert expected in printed(report)


def test_still_after_comes_first_and_a_lower_bound_is_marked(report: dict[str, Any]) -> None:
    axis = report["axes"]["near_far"]
    axis["raw"] |= {"still_s": 4.93, "swings_on": True}
    axis["shaped"] |= {"still_s": 1.71, "swings_on": False}
    text = printed(report)
    assert ">4.9 → 1.7" in text
    assert text.index("still after") < text.index("peak sway")
    assert "still: below 2 deg" in text
