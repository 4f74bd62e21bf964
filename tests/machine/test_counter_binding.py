"""Counters and signals of protected joysticks in a deployment: what they can be."""

import pytest

from canshaper.codec.frame import FrameFault
from canshaper.codec.message import SequenceChecker
from tests.machine.protected_joystick import COUNTER, SIGNALS, joystick
from tests.rigs.files import Machine


@pytest.mark.parametrize(
    ("counter", "usual"), [("Count1", 1), ("Count2", 2), ("Half", 3), ("AliveCounter", 3)]
)
def test_the_usual_step_suits_every_counter(protected: Machine, counter: str, usual: int) -> None:
    protected.in_yaml(COUNTER, f"alive_counter: {counter}")
    bound = protected.load().joysticks["left"]
    for step in range(1, bound.protection.counts):
        checker = SequenceChecker(bound.protection, bound.config.alive_max_step, 1)
        assert checker.check(b"", 0) is FrameFault.NONE
        expected = FrameFault.NONE if step <= usual else FrameFault.COUNTER_JUMP
        assert checker.check(b"", step) is expected


@pytest.mark.parametrize(
    ("counter", "most"), [("Count1", 1), ("Count2", 2), ("Half", 8), ("AliveCounter", 128)]
)
def test_a_step_is_at_most_half_of_the_counters_range(
    protected: Machine, counter: str, most: int
) -> None:
    """A step back must not look like one forward."""
    protected.in_yaml(COUNTER, f"alive_counter: {counter}\n    alive_max_step: {most}")
    assert protected.load().joysticks["left"].config.alive_max_step == most
    protected.in_yaml(f"alive_max_step: {most}", f"alive_max_step: {most + 1}")
    (problem,) = protected.problems()
    values = {1: 2, 2: 4, 8: 16, 128: 256}[most]
    expected = f"expected up to {most} with a counter of {values} values, got {most + 1}"
    assert expected in problem


@pytest.mark.parametrize("key", ["checksum", "alive_counter"])
def test_a_joystick_that_is_protection_too(protected: Machine, key: str) -> None:
    """A joystick that counts up with every frame would move the axis by itself."""
    protected.in_dbc(SIGNALS, ' SG_ Check : 48|8@1- (1,0) [-100|100] "" SHAPER\n')
    use = {"checksum": "checksum: { signal: Check, kind: sum }", "alive_counter": "qualify: 1"}
    joystick(protected, use[key])
    if key == "alive_counter":
        protected.in_yaml(COUNTER, "alive_counter: Check")
    line = protected.in_yaml("signal: Slew,", "signal: Check,")
    problems = protected.problems()
    expected = (
        f"axes.slew.command.signal: expected a free signal, got 'Check', which is {key} already"
    )
    assert f"machine.yaml:{line}: {expected}" in problems


@pytest.mark.parametrize("key", ["enable", "reset", "anti_sway_off"])
def test_a_switch_that_is_protection_too(protected: Machine, key: str) -> None:
    signal = {"enable": "Enable", "reset": "Reset", "anti_sway_off": "AntiSwayOff"}[key]
    line = protected.in_yaml(COUNTER, f"alive_counter: {signal}\n    alive_max_step: 2")
    assert protected.problems() == [
        f"machine.yaml:{line}: joysticks.left.alive_counter: expected a free signal, got"
        f" '{signal}', which is {key} already"
    ]
    protected.in_yaml(f"alive_counter: {signal}", f"checksum: {{ signal: {signal}, kind: xor }}")
    expected = f"expected a free signal, got '{signal}', which is {key} already"
    assert (
        f"machine.yaml:{line}: joysticks.left.checksum.signal: {expected}" in protected.problems()
    )


@pytest.mark.parametrize(
    ("signal", "says"),
    [("56|8@1-", "got a signed one"), ("32|32@1-", "got a float")],
)
def test_a_counter_that_cannot_count(machine: Machine, signal: str, says: str) -> None:
    kept = machine.dbc.index(" SG_ Enable : 32|2@1+")
    end = machine.dbc.index(" SG_ AliveCounter : 56|8@1+")
    if "float" in says:  # it takes the place of the switches
        machine.dbc = machine.dbc[:kept] + machine.dbc[end:]
        machine.in_dbc("VAL_ 272 Slew", "SIG_VALTYPE_ 272 AliveCounter : 1;\nVAL_ 272 Slew")
        for switch in ("Enable", "AntiSwayOff", "Reset"):
            machine.dbc = "".join(
                row
                for row in machine.dbc.splitlines(keepends=True)
                if not row.startswith(f"VAL_ 272 {switch}")
            )
    machine.in_dbc("AliveCounter : 56|8@1+", f"AliveCounter : {signal}")
    line = joystick(machine) - 1
    assert (
        f"machine.yaml:{line}: joysticks.left.alive_counter: AliveCounter: expected an unsigned"
        f" integer signal, {says}" in ("\n".join(machine.problems()))
    )
