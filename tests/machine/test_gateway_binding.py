"""A deployment with a gateway: what `canshaper check` refuses, and the rules that it makes."""

from pathlib import Path

import cantools
import pytest

from canshaper.codec.frame import EFF_FLAG
from canshaper.codec.rewrite import RewrittenMessage
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.protocols.gateway.cangw import AND, CS_CRC8, CS_XOR, OR
from canshaper.protocols.gateway.rules import excluded, fallback_rules, passing_rules
from tests.machine.gateway_files import changed, j1939_gateway, load, problems
from tests.rigs.files import ROOT, faults, machine_file

SLEW = "bus: machine, message: JoystickLeft, signal: Slew, timeout_ms: 200,"
COUNTER = "alive_counter: AliveCounter"
ROCKER = ("signal: NearFar, neutral_pct", "signal: NearFar, negative: Back, neutral_pct")


def test_what_is_not_passed_on_is_read_with_the_others(tmp_path: Path) -> None:
    blocked = ("fallback: neutral", "fallback: neutral\n  blocked: [GrappleSway, TipPosition]")
    extra = {m.name for m in load(tmp_path, blocked).messages.all()}
    assert extra - {m.name for m in load(tmp_path).messages.all()} == {"GrappleSway", "TipPosition"}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "[joysticks, machine]", "[joysticks, joysticks]",
            "gateway: between: expected two different buses, got joysticks twice",
        ),
        ("[joysticks, machine]", "[joysticks, crane]",
         "gateway.between.1: expected a bus, got 'crane'; there are joysticks, machine"),
        (
            "forwarding: kernel", "forwarding: daemon",
            "gateway: fallback: expected stop with forwarding: daemon, got neutral: without the"
            " daemon nothing passes",
        ),
        (
            "fallback: neutral", "fallback: neutral\n  blocked: [Nobody]",
            "gateway.blocked.0: expected a message of the DBC files, got 'Nobody'; there are"
            " AimPoint, GrappleSway, JointPosition, JointVelocity, JoystickLeft, JoystickRight,"
            " LiftCommand, LiftStatus, NearFarCommand, NearFarStatus, ShaperIdentity, ShaperStatus,"
            " SlewCommand, SlewStatus, TipPosition, TipVelocity",
        ),
        (
            SLEW, SLEW.replace("Slew", "NearFar"),
            "axes.slew.valve.signal: expected the signal of its command, 'Slew', in the message of"
            " its joystick, got 'NearFar'",
        ),
        (
            f"{SLEW} {COUNTER}", f"{SLEW}",
            "axes.slew.valve.alive_counter: expected the same as joystick left, got another",
        ),
        (SLEW, SLEW.replace("200", "120"),
         "axes.slew.valve.timeout_ms: expected more than 120 ms, a tick more than joystick left,"
         " whose receiver must not give up before we do, got 120"),
        (SLEW, f"{SLEW} direction: {{ signal: Reset, neutral: 0, positive: 1, negative: 2 }},",
         "axes.slew.valve.direction: expected none in the message of joystick left, which has that"
         " of the command, got one"),
        (SLEW, f"{SLEW} multiplexor: 3,",  # frames with another value would not pass
         "axes.slew.valve.multiplexor: expected none in the message of joystick left, which has"
         " that of the command, got one"),
        (SLEW, f"{SLEW} cycle_ms: 40,",
         "axes.slew.valve.cycle_ms: expected the same as joystick left, got another"),
        (f"{SLEW} {COUNTER}",
         "bus: machine, message: SlewCommand, signal: Velocity, timeout_ms: 200",
         "axes.slew.valve.message: expected JoystickLeft on bus machine, as the frames of joystick"
         " left leave with this command in them, got 'SlewCommand'"),
        ("joystick: left, signal: Slew", "joystick: right, signal: Rotate",
         "axes.slew.valve.message: expected the message of joystick right, or one of no joystick,"
         " got 'JoystickLeft' of joystick left"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_reported(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert message in changed(tmp_path, (old, new)).faults()


def test_a_valve_needs_the_second_signal_of_its_rocker(tmp_path: Path) -> None:
    says = "axes.near_far.valve.signal: expected a signal of JoystickLeft, got 'Back'; there are"
    assert any(says in one for one in problems(tmp_path, ROCKER))


def test_both_signals_of_a_rocker_are_rewritten(tmp_path: Path) -> None:
    dbc = (
        ' SG_ NearFar : 16|16@1- (0.1,0) [-100|100] "%" SHAPER\n',
        ' SG_ NearFar : 16|16@1+ (0.1,0) [0|100] "%" SHAPER\n'
        ' SG_ Back : 40|16@1+ (0.1,0) [0|100] "%" SHAPER\n',
    )
    valve = load(tmp_path, ROCKER, dbc=dbc).axes["near_far"].valve
    sent = valve.message
    assert isinstance(sent, RewrittenMessage)
    assert sent.ours == {"Slew", "NearFar", "Back"}
    sender = sent.sender()
    valve.put(sender.raw, -250)
    assert (sender.raw["NearFar"], sender.raw["Back"]) == (0, 250)
    assert sender.onto(b"\xff" * 8).data.hex() == "00000000fffa0001"


def test_an_ecu_that_waits_for_a_tick_longer_than_we_do_is_enough(tmp_path: Path) -> None:
    every = [("timeout_ms: 200", "timeout_ms: 121")] * 3
    assert {axis.config.valve.timeout_ms for axis in load(tmp_path, *every).axes.values()} == {121}


def test_a_fallback_needs_a_joystick_that_is_passed_on(tmp_path: Path) -> None:
    far = (
        "  far: { interface: socketcan, channel: vcan1 }\n"
        "gateway: { between: [crane, far], fallback: neutral }\ndbc:"
    )
    assert faults(machine_file(tmp_path, "forwarder", ("\ndbc:", far))) == [
        "gateway.fallback: expected stop where no valve has the message of a joystick on the other"
        " bus, got neutral"
    ]


def test_neutral_is_refused_where_the_kernel_cannot_protect_it(tmp_path: Path) -> None:
    """A checksum in byte 6 of 8."""
    checksum = "checksum: { signal: Checksum, kind: crc8_autosar }"
    changes = [("left:\n", f"left:\n    {checksum}\n"), (SLEW, f"{SLEW} {checksum},")]
    changes += [("NearFar, timeout_ms: 200,", f"NearFar, timeout_ms: 200, {checksum},")]
    dbc = ("\nBO_ 273", ' SG_ Checksum : 48|8@1+ (1,0) [0|255] "" SHAPER\n\nBO_ 273')
    (problem,) = problems(tmp_path, *changes, dbc=dbc)
    assert (
        "gateway.fallback: expected stop or pass, got neutral: can-gw of the kernel computes"
        " crc8_autosar in" in problem
    )
    assert load(tmp_path, *changes, ("fallback: neutral", "fallback: stop"), dbc=dbc)


def test_rules_pass_what_is_not_ours_and_neutral_joysticks(tmp_path: Path) -> None:
    deployment = load(tmp_path)
    ours = {0x110, 0x111, 0x300, 0x301, 0x302, 0x310, 0x311}
    assert {p.value for p in excluded(deployment)} == ours
    rules = passing_rules(deployment)
    for can_id in range(0x800):
        ends = [(r.source, r.destination) for r in rules if r.pattern.fits(can_id)]
        both = [("vcan0", "vcan1"), ("vcan1", "vcan0")]
        assert sorted(ends) == ([] if can_id in ours else both)
    left, right = sorted(fallback_rules(deployment), key=lambda rule: rule.pattern)
    assert (left.source, left.destination, left.pattern.value) == ("vcan0", "vcan1", 0x110)
    assert [kind for kind, _ in left.changes] == [AND, OR]
    assert left.changes[0][1][8:16] == b"\0\0\0\0\xff\xff\xff\xff"
    assert right.changes[0][1][8:16] == b"\0\0\xff\xff\xff\xff\xff\xff"


def test_what_is_blocked_passes_for_no_one(tmp_path: Path) -> None:
    blocked = ("fallback: neutral", "fallback: neutral\n  blocked: [GrappleSway]")
    before = {pattern.value for pattern in excluded(load(tmp_path))}
    assert {p.value for p in excluded(load(tmp_path, blocked))} - before == {0x400}
    file = j1939_gateway(tmp_path, source="source: 51,")
    before = {pattern.value for pattern in excluded(load_deployment(file))}
    text = file.read_text().replace("fallback: neutral", "fallback: neutral, blocked: [AVEF0]")
    file.write_text(text)
    (pattern,) = [p for p in excluded(load_deployment(file)) if p.value not in before]
    for priority in range(8):  # from whatever address
        assert pattern.fits(priority << 26 | 0x00FE1000 | 0x80 | EFF_FLAG)
    assert not pattern.fits(0x0CFE1100 | 0x80 | EFF_FLAG)


def test_without_a_fallback_there_is_no_rule_for_a_joystick(tmp_path: Path) -> None:
    assert fallback_rules(load(tmp_path, ("fallback: neutral", "fallback: stop"))) == []


def test_pass_changes_nothing(tmp_path: Path) -> None:
    rules = fallback_rules(load(tmp_path, ("fallback: neutral", "fallback: pass")))
    assert [rule.changes for rule in rules] == [(), ()]


@pytest.mark.parametrize(("kind", "number"), [("xor", CS_XOR), ("crc8_sae_j1850", CS_CRC8)])
def test_the_neutral_rule_makes_the_checksum(tmp_path: Path, kind: str, number: int) -> None:
    checksum = f"checksum: {{ signal: Checksum, kind: {kind} }}"
    changes = [("left:\n", f"left:\n    {checksum}\n"), (SLEW, f"{SLEW} {checksum},")]
    changes += [("NearFar, timeout_ms: 200,", f"NearFar, timeout_ms: 200, {checksum},")]
    dbc = (' SG_ AliveCounter : 56|8@1+ (1,0) [0|255] "" SHAPER\n\nBO_ 273',
           ' SG_ AliveCounter : 48|8@1+ (1,0) [0|255] "" SHAPER\n'
           ' SG_ Checksum : 56|8@1+ (1,0) [0|255] "" SHAPER\n\nBO_ 273')  # fmt: skip
    rules = fallback_rules(load(tmp_path, *changes, dbc=dbc))
    kinds = [kind for rule in rules for kind, _ in rule.changes]
    assert kinds.count(number) == 1


def test_a_joystick_of_j1939_keeps_its_address_and_passes_in_no_priority(tmp_path: Path) -> None:
    """Magnitude and flags are ours, the address is the joystick's, who is not on that bus."""
    deployment = load_deployment(j1939_gateway(tmp_path, source="source: 51,"))
    axis, message = deployment.config.axes["slew"], deployment.joysticks["left"].message
    flags = axis.command.flags
    assert flags
    sent = deployment.axes["slew"].valve.message
    assert isinstance(sent, RewrittenMessage)
    assert sent.key[1] & 0xFF == 51
    assert sent.ours == {axis.command.signal, flags.neutral, flags.positive, flags.negative}
    group = next(p for p in excluded(deployment) if p.mask != 0x9FFFFFFF)
    assert group.value == (message.frame_id & 0x03FFFF00) | 51 | EFF_FLAG
    assert group.mask == 0x03FFFFFF | EFF_FLAG
    assert deployment.routing.buses["far"].sent_groups == set()
    sender = sent.sender()
    neutral = sender.onto(bytes(8))
    network = cantools.database.load_file(ROOT / "dbc" / "j1939-bjm-avc.dbc")
    values = network.decode_message(message.frame_id, neutral.data, decode_choices=False)
    assert isinstance(values, dict)
    assert (values[flags.neutral], values[flags.positive], values[flags.negative]) == (1, 0, 0)
    deployment.axes["slew"].valve.put(sender.raw, -sent_steps(deployment))
    values = network.decode_message(
        message.frame_id, sender.onto(bytes(8)).data, decode_choices=False
    )
    assert isinstance(values, dict)
    assert (values[flags.neutral], values[flags.positive], values[flags.negative]) == (0, 0, 1)
    assert values[axis.command.signal] == pytest.approx(100.0, abs=0.5)


def test_what_one_node_sends_to_another_is_held_back_at_every_priority(tmp_path: Path) -> None:
    """A joystick and a valve of J1939 with a destination: what is theirs once is theirs at all."""
    dbc = (ROOT / "dbc" / "j1939-bjm-avc.dbc").read_text("cp1252")
    joystick, valve = 0x0CEF2733, 0x0CEF3000
    dbc = dbc.replace("2365445886", str(joystick | EFF_FLAG)).replace(
        "2365468926", str(valve | 0xFE | EFF_FLAG)
    )
    (tmp_path / "machine.dbc").write_text(dbc, "cp1252")
    text = (ROOT / "config" / "j1939-forwarder.yaml").read_text()
    text = text.replace("../dbc/j1939-bjm-avc.dbc", "machine.dbc").replace(
        "\ndbc:", "  far: { interface: socketcan, channel: can1 }\n"
        "gateway: { between: [crane, far], fallback: stop }\ndbc:", 1
    )  # fmt: skip
    file = tmp_path / "machine.yaml"
    file.write_text(text)
    deployment = load_deployment(file)
    own = deployment.config.buses["crane"].j1939
    assert own is not None
    rules = passing_rules(deployment)
    for priority in range(8):
        for can_id in (joystick, valve | own.address):
            word = can_id & 0x03FFFFFF | priority << 26 | EFF_FLAG
            assert not [rule for rule in rules if rule.pattern.fits(word)], hex(word)
        other = 0x00EF2744 | priority << 26 | EFF_FLAG
        assert len([rule for rule in rules if rule.pattern.fits(other)]) == 2


def sent_steps(deployment: Deployment) -> int:
    return deployment.axes["slew"].valve.steps


def test_a_bit_does_not_leave_through_the_gateway_as_a_switch(tmp_path: Path) -> None:
    (problem,) = problems(tmp_path, ("enable: Enable", "enable: Enable/0"))
    text = "expected a whole signal, whose frames leave through the gateway, got 'Enable/0'"
    assert problem.endswith(f": joysticks.left.enable: {text}")
