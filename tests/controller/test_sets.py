"""Grapple and operator choose sway data and filter, by frames; what does not fit is reported."""

from collections.abc import Callable

import pytest

from canshaper.codec.frame import Frame
from canshaper.errors import ConfigError
from canshaper.shaping.shapers.gff import Gff
from tests.controller.set_files import DBC, FAST, FAST_SETS, SETS, SLEW, YAML
from tests.rigs.forwarder import Rig

Make = Callable[..., Rig]


def load(kg: int) -> Frame:
    return Frame("crane", 1296, False, kg.to_bytes(2, "little") + bytes(2))


def feel(code: int) -> Frame:
    return Frame("crane", 1297, False, bytes((code,)))


def period_s(rig: Rig) -> float:
    sway = rig.controller.axes["slew"].axis.sway
    assert sway is not None
    return sway.mode.period_s


def poles(rig: Rig) -> tuple[float, float]:
    shaper = rig.controller.axes["slew"].axis._transfer._shaper
    assert isinstance(shaper, Gff)
    return shaper.poles_rad_s


@pytest.fixture
def chosen(changed_rig: Make) -> Rig:
    rig = changed_rig(yaml=YAML, dbc=DBC)
    rig.run(3)
    return rig


def test_without_a_signal_the_axis_has_its_own_set(chosen: Rig) -> None:
    chosen.run(100)
    assert period_s(chosen) == pytest.approx(2.356)
    assert chosen.controller.axes["slew"].chooser.number == 0  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("kg", "period", "number"),
    [(0, 2.3, 1), (1000, 2.9, 2), (500, 2.6, 1), (750, 2.75, 2), (4000, 2.9, 2)],
)
def test_the_weight_chooses(chosen: Rig, kg: int, period: float, number: int) -> None:
    chosen.receive(load(kg))
    chosen.run(10)
    assert period_s(chosen) == pytest.approx(period, abs=0.005)
    assert chosen.controller.axes["slew"].chooser.number == number  # type: ignore[union-attr]


def test_the_weight_chooses_where_the_operator_has_no_choice(changed_rig: Make) -> None:
    alone = {SLEW: SLEW + SETS.partition("    profiles:")[0]}
    rig = changed_rig(yaml={**YAML, **alone}, dbc=DBC)
    rig.run(3)
    rig.receive(load(1000))
    rig.run(10)
    assert period_s(rig) == pytest.approx(2.9)
    rig.receive(feel(1))
    rig.run(10)
    assert period_s(rig) == pytest.approx(2.9)


def test_an_axis_without_a_choice_reports_the_set_0(changed_rig: Make) -> None:
    rig = changed_rig(dbc=DBC)
    reported = [
        sent["SlewStatus"]["ActiveSet"] for _ in range(20) if "SlewStatus" in (sent := rig.run())
    ]
    assert set(reported) == {0}


def test_a_weight_that_is_lost_or_not_available_is_none(chosen: Rig) -> None:
    chosen.receive(load(1000))
    chosen.run(10)
    for _ in range(12):
        chosen.receive(load(65535))
        chosen.run(5)
    assert period_s(chosen) == pytest.approx(2.356)


@pytest.mark.parametrize("data", ["0000c07f", "0000807f", "000080ff"])  # NaN, inf, -inf
def test_a_weight_that_is_no_number_is_none(changed_rig: Make, data: str) -> None:
    text = {**DBC, "BO_ 512 SlewCommand": DBC["BO_ 512 SlewCommand"].replace("0|16@1+", "0|32@1-")}
    cycles = 'BA_ "GenMsgCycleTime" BO_ 512 20;'
    text[cycles] = text[cycles].replace(
        'VAL_ 1296 Weight 65535 "NotAvailable" ;', "SIG_VALTYPE_ 1296 Weight : 1;"
    )
    rig = changed_rig(yaml=YAML, dbc=text)
    rig.run(3)
    rig.receive(Frame("crane", 1296, False, bytes.fromhex("00007a44")))  # 1000.0
    rig.run(10)
    assert period_s(rig) == pytest.approx(2.9)
    for _ in range(12):
        rig.receive(Frame("crane", 1296, False, bytes.fromhex(data)))
        rig.run(5)
    assert period_s(rig) == pytest.approx(2.356)


def test_the_operator_chooses(chosen: Rig) -> None:
    base = poles(chosen)
    chosen.receive(feel(1))
    chosen.run(10)
    fast = poles(chosen)
    chosen.receive(feel(2))
    chosen.run(10)
    calm = poles(chosen)
    assert max(fast) < max(base) < max(calm)
    assert chosen.controller.axes["slew"].chooser.number == 4  # type: ignore[union-attr]
    chosen.receive(feel(7))  # no choice of ours
    chosen.run(10)
    assert poles(chosen) == base


@pytest.mark.parametrize(("kg", "number"), [(0, 4), (600, 5), (1000, 5)])
def test_the_weight_chooses_among_the_sets_of_a_profile(
    changed_rig: Make, kg: int, number: int
) -> None:
    """Their numbers follow those of the axis and of the profile itself."""
    rig = changed_rig(yaml={**YAML, SLEW: SLEW + SETS.replace(FAST, FAST_SETS)}, dbc=DBC)
    rig.run(3)
    rig.receive(load(kg), feel(1))
    rig.run(10)
    assert rig.controller.axes["slew"].chooser.number == number  # type: ignore[union-attr]


def test_the_status_reports_it_where_there_is_a_signal(chosen: Rig) -> None:
    chosen.receive(load(1000))
    for _ in range(20):
        sent = chosen.run(1)
        if "SlewStatus" in sent and sent["SlewStatus"].get("ActiveSet"):
            break
    assert sent["SlewStatus"]["ActiveSet"] == 2


@pytest.mark.parametrize(
    "sway",
    [
        "length_m: 30, mass_kg: 300, damping_nms: 270000",  # period 22.6 s
        "period_s: 12, damping_ratio: 0.449",  # 12.000000000000002 s
    ],
)
def test_between_two_sets_of_a_very_slow_swing_the_loop_goes_on(
    changed_rig: Make, sway: str
) -> None:
    sets = SETS.replace("period_s: 2.3, damping_ratio: 0.04", sway)
    sets = sets.replace("period_s: 2.9, damping_ratio: 0.05", sway)
    rig = changed_rig(yaml={**YAML, SLEW: SLEW + sets}, dbc=DBC)
    rig.run(3)
    rig.receive(load(1000))
    rig.run(20, Slew=900)
    slow, full = period_s(rig), poles(rig)
    rig.receive(load(500))
    rig.run(10, Slew=900)
    assert period_s(rig) == pytest.approx(slow)
    assert max(poles(rig)) < max(full)
    assert rig.controller.axes["slew"].axis.sent > 0.0


def test_what_cannot_run_between_two_sets_is_reported(changed_rig: Make) -> None:
    """Taps may miss the sum 1 by a thousandth; between two such, rounding can make it more."""
    one = "kind: robust, tick_ms: 20, taps: [0.056, 0.87, 0.075]"
    two = "kind: robust, tick_ms: 20, taps: [0.57, 0.2, 0.231]"
    slew = SLEW.replace("kind: gff, a1: 0.708, a2: 0.12", one)
    sets = SETS.partition("    profiles:")[0].replace("kind: gff, a1: 0.7, a2: 0.12", one)
    changed = {**YAML, SLEW: slew + sets.replace("kind: gff, a1: 0.9, a2: 0.2", two)}
    with pytest.raises(ConfigError) as caught:
        changed_rig(yaml=changed, dbc=DBC)
    (problem,) = caught.value.problems
    text = "at 31.25, between two breakpoints: sum of the taps: expected 1, got 1.001"
    assert f"axes.slew.gain_schedule: {text}" in str(problem)


def test_in_full_motion_nothing_jumps(chosen: Rig) -> None:
    chosen.receive(load(0))
    chosen.run(200, Slew=900)
    last = chosen.controller.axes["slew"].axis.sent
    for n in range(200):
        chosen.receive(load(1000 if n // 20 % 2 else 0), feel(n // 33 % 3))
        chosen.run(1, Slew=900)
        sent = chosen.controller.axes["slew"].axis.sent
        assert abs(sent - last) <= 0.02
        last = sent


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "breakpoint: 1000",
            "breakpoint: 0",
            "axes.slew: expected rising breakpoints, got 0, 0",
        ),
        (
            "filter: { kind: gff, a1: 0.9, a2: 0.2 }",
            "filter: { kind: zv }",
            "axes.slew: expected the filter of the axis, gff, got zv at a breakpoint",
        ),
        (
            "      fast: {",
            "      quick: {",
            "profiles.quick: expected a profile, got 'quick'; there are balanced, fast",
        ),
        (
            "signal: Weight",
            "signal: Mass",
            "load_state.signal: expected a signal of Load, got 'Mass'; there are",
        ),
        (
            "load_state: { bus: crane, message: Load, signal: Weight, timeout_ms: 500 }\n",
            "",
            "axes.slew.gain_schedule: expected load_state, which chooses them, got none",
        ),
        (
            "filter: { kind: gff, a1: 0.5, a2: 0.06 }",
            "filter: { kind: gff, poles_rad_s: [-60, -3] }",
            "axes.slew.profiles.fast.filter: pole: expected -50 to below 0 rad/s at a tick of"
            " 0.02 s, got -60 rad/s",
        ),
    ],
)
def test_what_does_not_fit_is_reported(changed_rig: Make, old: str, new: str, says: str) -> None:
    changed = {key: value.replace(old, new) for key, value in YAML.items()}
    assert changed != YAML
    with pytest.raises(ConfigError) as caught:
        changed_rig(yaml=changed, dbc=DBC)
    assert any(says in str(problem) for problem in caught.value.problems), caught.value.problems


def test_a_value_that_the_dbc_names_default_is_a_choice(changed_rig: Make) -> None:
    names = 'VAL_ 1297 Feel 0 "Calm" 1 "Default" ;'
    rig = changed_rig(yaml=YAML, dbc=DBC | {"VAL_ 272 Enable": f"{names}\nVAL_ 272 Enable"})
    rig.run(3)
    base = poles(rig)
    rig.receive(feel(1))
    rig.run(10)
    assert max(poles(rig)) < max(base)


@pytest.mark.parametrize(
    ("names", "says"),
    [
        (
            'VAL_ 1297 Feel 1 "Error" ;',
            "profile.codes.fast: expected a value of Feel that the DBC names no error, got 1,"
            " Error",
        ),
        (
            'VAL_ 1296 Weight 1000 "Reserved" ;',
            "axes.slew.gain_schedule.1.breakpoint: expected a value of Weight that the DBC names no"
            " error, got 1000, Reserved",
        ),
    ],
)
def test_a_value_that_the_dbc_names_an_error_is_no_choice(
    changed_rig: Make, names: str, says: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        changed_rig(yaml=YAML, dbc=DBC | {"VAL_ 272 Enable": f"{names}\nVAL_ 272 Enable"})
    (problem,) = caught.value.problems
    assert says in str(problem)
    assert problem.line is not None
