"""Keys for which C has no part are refused by name; numbers are exact to the last bit."""

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from canshaper import Fir
from canshaper.config.limits import Limits
from canshaper.errors import ConfigError
from canshaper.machine.deployment import Deployment
from canshaper.native.library import C_FILES, sizes_source, tables_source
from canshaper.native.tables import tables
from canshaper.shaping.registry import KINDS
from canshaper.shaping.shapers.kind import Shaper, ShaperKind
from canshaper.shaping.shapers.limit_aware import LimitAware
from canshaper.shaping.states import Reason, State
from tests.native.machines import SHIPPED
from tests.rigs.files import CONFIG, Machine, read

REFUSED = sorted(
    path.name for path in CONFIG.glob("*.yaml") if path.stem not in SHIPPED and path.is_file()
)


class NewLimits(Limits):
    """Limits with a key that nobody has built into the C."""

    new: float = 1.0


def test_a_key_that_the_c_does_not_follow_is_refused_unless_it_has_its_default(
    machine: Machine,
) -> None:
    deployment = machine.load()
    axis = deployment.config.axes["slew"]

    def with_new(value: float) -> Deployment:
        limits = NewLimits.model_construct(**dict(axis.limits), new=value)
        changed = {"slew": axis.model_copy(update={"limits": limits})}
        config = deployment.config.model_copy(update={"axes": deployment.config.axes | changed})
        return replace(deployment, config=config)

    tables(with_new(1.0))
    with pytest.raises(ConfigError, match=r"axes\.slew\.limits\.new: expected none in an export"):
        tables(with_new(2.0))


def problems(machine: Machine) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        tables(machine.load())
    return [str(one).partition("machine.yaml")[2] for one in caught.value.problems]


@pytest.mark.parametrize("name", REFUSED)
def test_a_shipped_machine_with_more_is_refused_by_its_keys(name: str) -> None:
    with pytest.raises(ConfigError) as caught:
        tables(read(CONFIG / name))
    for problem in caught.value.problems:
        assert problem.line is not None
        assert "in an export" in problem.message


def test_what_is_refused_is_named_with_its_line(machine: Machine) -> None:
    line = machine.in_yaml(
        "    enable: Enable\n", "    enable: Enable\n    checksum: { signal: X, kind: xor }\n"
    )
    machine.in_dbc(
        " SG_ AliveCounter : 56|8@1+",
        ' SG_ X : 48|8@1+ (1,0) [0|255] "" SHAPER\n SG_ AliveCounter : 56|8@1+',
    )
    text = "joysticks.left.checksum: expected none in an export, for which C has no part"
    assert problems(machine) == [f":{line + 1}: {text}"]


def test_a_counter_with_more_values_than_c_counts_is_refused(machine: Machine) -> None:
    """A count of 2^32 values would become 0: none of its frames would be checked."""
    machine.in_dbc(" SG_ AliveCounter : 56|8@1+", " SG_ AliveCounter : 38|26@1+")
    text = "expected a whole signal of up to 24 bits in an export, got AliveCounter"
    assert problems(machine)[0].endswith(text)


class Other(Fir):
    pass


@pytest.mark.parametrize(
    "build", [lambda _: Other([1.0]), lambda sway: LimitAware(sway, Other([1.0]))]
)
def test_a_filter_of_another_class_is_refused(
    machine: Machine, monkeypatch: pytest.MonkeyPatch, build: Callable[[Any], Shaper]
) -> None:
    kind = ShaperKind(
        "zv", "Another.", build, lambda *_: {"other": {}}, needs_sway=True, runs_ahead=False
    )
    monkeypatch.setitem(KINDS, "zv", kind)
    machine.in_yaml("filter: { kind: gff, a1: 0.708, a2: 0.12 }", "filter: { kind: zv }")
    (text,) = problems(machine)
    assert text.endswith("axes.slew.filter.kind: expected a filter that C has, got zv")


def test_the_numbers_are_exact() -> None:
    found = tables(read(CONFIG / "forwarder-robust.yaml"))
    source = tables_source(found)
    first, second, *_ = found["axis"][0]["runs"]
    assert (first["end"], second["end"], len(found["axis"][0]["runs"])) == (2, 3, 9)
    assert f"{{.end = 2, .tap = R({first['tap'].hex()})}},\n    {{.end = 3, .tap = R(" in source
    assert ".run_on = HUGE_VAL" in source  # of lift, which no distance bounds
    assert "#define CS_TAPS 91\n#define CS_WINDOW 111\n" in sizes_source(found)


def test_the_sign_of_a_zero_is_kept() -> None:
    numbers = tables(read(CONFIG / "forwarder.yaml"))
    numbers["axis"][0]["deadband"] = -0.0
    assert ".deadband = R(-0x0.0p+0)" in tables_source(numbers)


def test_no_line_of_the_source_is_code() -> None:
    source = tables_source(tables(read(CONFIG / "forwarder-joints.yaml")))
    for line in source.splitlines():
        starts = ("const cs_config ", "const cs_row ", "const int32_t ", "#", "/*", "    {")
        assert not line or line.startswith(starts), line


def test_states_and_reasons_of_the_c_have_the_numbers_of_the_program() -> None:
    header = (C_FILES / "src" / "canshaper.h").read_text(encoding="utf-8")
    states, reasons = re.findall(r"^enum \{(.*?)\};", header, re.M | re.S)[:2]
    assert re.findall(r"CS_(\w+)", states) == [state.name for state in State]
    numbers = dict(re.findall(r"CS_(\w+) = (\d+)", reasons))
    assert numbers
    assert {name: int(number) for name, number in numbers.items()} == {
        name: int(Reason[name]) for name in numbers
    }
