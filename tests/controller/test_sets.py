"""Grapple and operator choose sway data and filter, by frames; what does not fit is reported."""

import pytest

from canshaper.codec.frame import Frame
from canshaper.errors import ConfigError
from canshaper.shaping.shapers.gff import Gff
from tests.controller.set_files import DBC, FAST, FAST_SETS, SETS, SLEW, YAML
from tests.rigs.forwarder import Make, Rig


def load(kg: int) -> Frame:
    return Frame("crane", 1296, False, kg.to_bytes(2, "little") + bytes(2))


def feel(code: int) -> Frame:
    return Frame("crane", 1297, False, bytes((code,)))


def period_s(rig: Rig) -> float:
    sway = rig.controller.axes["slew"].axis.sway
    assert sway is not None
    return sway.mode.period_s


def poles(rig: Rig) -> tuple[float, float]:
    shaper = rig.controller.axes["slew"].axis.transfer.shaper
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
