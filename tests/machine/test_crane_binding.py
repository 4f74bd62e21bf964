"""Each fault of the section crane, and of a rope, is one clear line."""

from pathlib import Path

import pytest

from canshaper.inputs.value import MeasuredSignal
from canshaper.machine.binding import load_deployment
from tests.rigs.files import CONFIG, ROOT, problems, read
from tests.rigs.overhead import FILE, changed

CRANE = "crane: { kind: cartesian, bridge: bridge, trolley: trolley, hoist: hoist }"
LENGTH = "length: { bus: crane, message: CranePosition, signal: RopeLength, timeout_ms: 200,"
RANGE = "lowest_m: 1.5, highest_m: 30"


def test_the_file_says_which_axis_moves_what() -> None:
    moves = {"bridge": "bridge", "trolley": "trolley", "hoist": "hoist"}
    assert read(FILE).coordinates == moves


def test_without_it_the_names_say_it() -> None:
    moves = {"slew": "slew", "near_far": "near_far", "lift": "lift"}
    assert read(CONFIG / "forwarder.yaml").coordinates == moves
    assert read(CONFIG / "forwarder.yaml").by_coordinate == moves
    assert set(read(CONFIG / "forwarder-joints.yaml").coordinates) == {
        "slew",
        "lift_cylinder",
        "knuckle",
        "extension",
    }


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("hoist: hoist }", "hoist: winch }", "crane.hoist: expected an axis, got 'winch'"),
        ("trolley: trolley", "trolley: bridge", "crane.trolley: expected an axis of its own, got"),
        (
            "kind: cartesian",
            "kind: polar",
            "crane.kind: expected one of 'cylindrical', 'cartesian'",
        ),
        ("kind: cartesian, ", "", "crane.kind: expected one of 'cylindrical', 'cartesian'"),
        (RANGE, "lowest_m: 5, highest_m: 5", "highest_m: expected more than lowest_m, got 5"),
        (RANGE, "offset_m: -15, lowest_m: 1.5, highest_m: 150", "within the range of RopeLength"),
        (RANGE, f"{RANGE}, lost: guess", "lost: expected 'longest', 'hold' or 'neutral'"),
        ("signal: RopeLength", "signal: Rope", "expected a signal of CranePosition, got 'Rope'"),
    ],
)
def test_what_is_none_is_said_in_a_line(tmp_path: Path, old: str, new: str, says: str) -> None:
    assert says in rope_problems(tmp_path, (old, new))


def rope_problems(tmp_path: Path, *changes: tuple[str, str]) -> str:
    return "\n".join(problems(changed(tmp_path, *changes)))


def test_a_signal_without_a_range_is_no_length(tmp_path: Path) -> None:
    dbc = (ROOT / "dbc" / "bridge-crane.dbc").read_text(encoding="cp1252")
    path = changed(tmp_path, (str(ROOT / "dbc" / "bridge-crane.dbc"), "own.dbc"))
    for old, new, says in (
        ('[0.5|160] "m"', '[0|0] "m"', "RopeLength has no range in the DBC; what lies outside is"),
        ('[0.5|160] "m"', '[0.5|160] "deg"', "RopeLength: expected a length in m, got a signal in"),
    ):
        (tmp_path / "own.dbc").write_text(dbc.replace(old, new), encoding="cp1252")
        assert any(says in problem for problem in problems(path))


@pytest.mark.parametrize(("code", "m"), [("", 0), ("Virhe: value", 1.25), ("Virhe: fault", None)])
def test_a_named_length_is_what_the_file_says(tmp_path: Path, code: str, m: object) -> None:
    dbc = ROOT / "dbc" / "bridge-crane.dbc"
    text = dbc.read_text(encoding="cp1252") + 'VAL_ 1040 RopeLength 500 "Virhe" 501 "Error" ;\n'
    (tmp_path / "own.dbc").write_text(text, encoding="cp1252")
    keys = ("signal: RopeLength,", f"signal: RopeLength, codes: {{ {code} }},")
    path = changed(tmp_path, (str(dbc), "own.dbc"), keys)
    if not code:
        says = 'sway.length.codes to say whether 500 "Virhe" is a value (1.25 m) or a fault'
        assert [says in problem for problem in problems(path)] == [True, True]
        return
    rope = load_deployment(path).axes["bridge"].rope
    measured = MeasuredSignal(rope.signal, 0.5, 160.0) if rope else None
    assert measured and measured.value({"RopeLength": 500}) == m
    assert measured.value({"RopeLength": 501}) is None


def test_a_filter_that_follows_no_rope_is_refused(tmp_path: Path) -> None:
    text = FILE.read_text(encoding="utf-8")
    start = text.index("    filter:\n")
    end = text.index("    limits:", start)
    says = rope_problems(tmp_path, (text[start:end], "    filter: { kind: zvd }\n"))
    assert "sway.length: expected a filter that follows it, gff, robust, got zvd" in says


def test_a_second_mode_is_refused_with_a_rope(tmp_path: Path) -> None:
    second = "second: { period_s: 1.2, damping_ratio: 0.005, length_range_pct: 20 }, duration_s"
    says = rope_problems(tmp_path, ("duration_s", second))
    assert "filter.designed_for.second: expected none with sway.length" in says


def test_a_schedule_beside_it_is_refused(tmp_path: Path) -> None:
    point = (
        "{ breakpoint: 0, sway: { period_s: 2, damping_ratio: 0, full_speed_m_s: 1 }, filter: F }"
    )
    text = FILE.read_text(encoding="utf-8")
    start = text.index("    filter:\n")
    end = text.index("    limits:", start)
    gff = "{ kind: gff, a1: 1, a2: 0.2 }"
    lines = f"    filter: {gff}\n    gain_schedule: [{point.replace('F', gff)}]\n"
    says = rope_problems(tmp_path, (text[start:end], lines))
    assert "sway.length: expected no gain_schedule with it" in says
    inner = lines.replace("full_speed_m_s: 1 }", f"full_speed_m_s: 1, {LENGTH} {RANGE} }} }}", 1)
    says = rope_problems(tmp_path, (text[start:end], inner))
    assert "expected no length at a breakpoint, but in the sway of the axis" in says


def test_numbers_that_the_length_chooses_are_not_adjustable(tmp_path: Path) -> None:
    control = "control: { adjustable: { axes.bridge.limits.max_pct: [50, 100] } }\nuncertainty:"
    says = rope_problems(tmp_path, ("uncertainty:", control))
    assert "axis bridge has a measured length, which chooses its numbers" in says


@pytest.mark.slow
def test_check_looks_at_both_ends_of_the_rope(tmp_path: Path) -> None:
    """The taps of the longest rope have to end in the tail, those of the shortest be slow."""
    from canshaper.commissioning.likely_mistakes import warnings_of

    deployment = load_deployment(changed(tmp_path, ("tail_s: 10", "tail_s: 5")))
    texts = [str(one) for one in warnings_of(deployment)]
    assert any("expected limits.tail_s of 9.39 s or more, got 5 s" in text for text in texts)
    texts = [str(one) for one in warnings_of(read(FILE))]
    assert texts == []
    slow = changed(tmp_path, ("length_m: 1.5", "length_m: 10"))
    texts = [str(one) for one in warnings_of(load_deployment(slow))]
    assert any("expected a valve of 5.16 full speeds per s or more" in text for text in texts)
