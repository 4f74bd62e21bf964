"""A deployment as a whole: its parts, what runs, and who only listens or reports nothing."""

import re
from hashlib import sha256
from pathlib import Path

import pytest

from canshaper.machine import identity
from canshaper.machine.binding import load_deployment
from canshaper.machine.buses import BusLoad
from canshaper.machine.deployment import Deployment
from tests.controller.set_files import DBC, FAST, FAST_SETS, YAML
from tests.rigs.files import ROOT, Machine, machine_file


def shipped(name: str) -> Deployment:
    return load_deployment(ROOT / "config" / f"{name}.yaml")


@pytest.fixture
def chosen(machine: Machine) -> Machine:
    """The shipped machine with two loads, and profiles with two loads of their own."""
    for old, new in YAML.items():
        machine.in_yaml(old, new)
    for old, new in DBC.items():
        machine.in_dbc(old, new)
    machine.in_yaml(FAST, FAST_SETS)
    return machine


def test_every_section_has_its_part(chosen: Machine) -> None:
    deployment = chosen.load()
    assert deployment.path == chosen.directory / "machine.yaml"
    assert list(deployment.joysticks) == ["left", "right"]
    assert list(deployment.axes) == ["slew", "near_far", "lift"]
    assert (deployment.motions, deployment.switches) == ({}, [])
    assert deployment.emergency_stop is None
    assert deployment.load_state is not None
    assert deployment.load_state.key == ("crane", 1296, False)
    assert deployment.profile is not None
    assert deployment.profile.key == ("crane", 1297, False)
    assert (deployment.listen_only, deployment.fd) == (False, frozenset())
    assert deployment.status is not None
    assert deployment.status.message.key == ("crane", 0x310, False)
    assert deployment.status_ticks == 25
    assert deployment.identity_status is not None
    assert deployment.identity_status.message.key == ("crane", 0x311, False)


def test_what_runs_is_told_by_the_bytes_of_the_files(machine: Machine) -> None:
    deployment = machine.load()
    hashes = [
        sha256((machine.directory / name).read_bytes()).hexdigest()
        for name in ("machine.yaml", "machine.dbc")
    ]
    assert deployment.identity == identity.Identity(hashes[0], {"machine.dbc": hashes[1]}, ())
    assert [file.sha256 for file in deployment.messages.files] == hashes[1:]


def error_names(machine: Machine, names: str) -> list[str]:
    """Problems with names of values in the DBC, without file and line."""
    machine.in_dbc("VAL_ 272 Enable", f"{names}\nVAL_ 272 Enable")
    return machine.faults()


def test_no_breakpoint_is_a_value_that_is_an_error(chosen: Machine) -> None:
    chosen.in_dbc('VAL_ 1296 Weight 65535 "NotAvailable" ;', "")
    expected = "expected a value of Weight that the DBC names no error, got 1000, Reserved"
    assert error_names(chosen, 'VAL_ 1296 Weight 1000 "Reserved" ;') == [
        f"axes.slew.gain_schedule.1.breakpoint: {expected}",
        f"axes.slew.profiles.fast.gain_schedule.1.breakpoint: {expected}",
    ]


def test_no_profile_is_a_value_that_is_an_error(chosen: Machine) -> None:
    assert error_names(chosen, 'VAL_ 1297 Feel 1 "Error" 7 "Error" ;') == [
        "profile.codes.fast: expected a value of Feel that the DBC names no error, got 1, Error"
    ]


def test_values_of_a_signal_that_there_is_not_are_not_compared(chosen: Machine) -> None:
    chosen.in_yaml("signal: Weight", "signal: Wait")
    chosen.in_yaml("signal: Feel", "signal: Fell")
    assert [problem.split(": ")[1] for problem in chosen.problems()] == [
        "load_state.signal",
        "profile.signal",
    ]


@pytest.mark.parametrize(
    ("section", "message"), [("status", "ShaperStatus"), ("identity", "ShaperIdentity")]
)
def test_a_status_message_that_there_is_not(machine: Machine, section: str, message: str) -> None:
    line = machine.in_yaml(f"message: {message}", "message: Nothing")
    (problem,) = machine.problems()
    assert problem.startswith(
        f"machine.yaml:{line}: {section}.message: expected a message of the DBC files, got"
        " 'Nothing'; there are "
    )


def test_ticks_follow_a_joystick_that_there_is(machine: Machine) -> None:
    line = machine.in_yaml("tick_ms: 20", "tick: { follow: mid }\ntick_ms: 20")
    assert machine.problems() == [
        f"machine.yaml:{line}: tick.follow: expected a joystick, got 'mid'; there are left, right"
    ]
    machine.in_yaml("follow: mid", "follow: left")
    assert machine.load().config.tick is not None


def test_packages_of_checksums_and_filters_are_named(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[list[str]] = []

    def lines(kinds: set[str]) -> list[str]:
        asked.append(sorted(kinds))
        return [f"filter {kind}" for kind in sorted(kinds)]

    monkeypatch.setattr("canshaper.machine.binding.filter_lines", lines)
    monkeypatch.setattr(
        "canshaper.checksums.kinds.package_line",
        lambda kind: None if kind == "xor" else f"checksum {kind}",
    )
    signals = ' SG_ Check : 40|8@1+ (1,0) [0|255] "" SHAPER\n'
    last = ' SG_ AliveCounter : 56|8@1+ (1,0) [0|255] "" SHAPER\n'
    machine.dbc = machine.dbc.replace(last, last + signals)
    for name, kind in (("Left", "xor"), ("Right", "sum")):
        message = f"    message: Joystick{name}\n"
        machine.in_yaml(message, f"{message}    checksum: {{ signal: Check, kind: {kind} }}\n")
    packages = machine.load().identity.packages
    assert packages == ("checksum sum", "filter gff", "filter off")
    assert asked == [["gff", "off"]]


def test_filters_of_profiles_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[set[str]] = []

    def lines(kinds: set[str]) -> list[str]:
        asked.append(kinds)
        return ["line"]

    monkeypatch.setattr("canshaper.machine.binding.filter_lines", lines)
    assert shipped("j1939-profiles").identity.packages == ("line",)
    assert asked == [{"robust", "off"}]


# -- buses -----------------------------------------------------------------------------------------


def test_a_bus_without_a_message_has_no_load(machine: Machine) -> None:
    bus = "buses:\n  boom: { interface: socketcan, channel: vcan1"
    machine.in_yaml("buses:\n", f"{bus}, bitrate: 125000 }}\n")
    assert machine.load().load("boom") == BusLoad(0.0, 0)


# -- inputs and senders ----------------------------------------------------------------------------


def test_inputs_in_their_order(chosen: Machine) -> None:
    deployment = chosen.load()
    assert [one.message.name for one in deployment.inputs()] == [
        *("JoystickLeft", "JoystickRight", "Load", "Choice")
    ]
    assert [one.message.name for one in deployment.stopping_inputs] == [
        *("JoystickLeft", "JoystickRight")
    ]


def test_an_emergency_stop_is_an_input_that_stops(machine: Machine) -> None:
    machine.yaml += (
        "emergency_stop: { bus: crane, message: GrappleSway, signal: SwayParallel,"
        " timeout_ms: 100 }\n"
    )
    signal = 'SwayParallel : 16|16@1- (0.01,0) [-180|180] "deg"'
    machine.in_dbc(signal, 'SwayParallel : 16|1@1+ (1,0) [0|1] ""')
    deployment = machine.load()
    assert deployment.emergency_stop is not None
    for inputs in (deployment.inputs(), deployment.stopping_inputs):
        assert [one.message.name for one in inputs] == [
            *("JoystickLeft", "JoystickRight", "GrappleSway")
        ]


def test_what_valves_and_a_sensor_report_is_an_input() -> None:
    deployment = shipped("canopen-forwarder")
    assert [one.message.name for one in deployment.inputs()] == [
        *("JoystickLeft", "JoystickRight", "SlewSpool", "SlewValve"),
        *("NearFarSpool", "NearFarValve", "LiftSpool", "LiftValve"),
    ]
    sensed = [one.message.name for one in shipped("forwarder-sensor").inputs()]
    assert sensed.count("SwayAngle") == 1


def test_a_radius_is_an_input() -> None:
    inputs = [one.message.name for one in shipped("j1939-profiles").inputs()]
    assert inputs == ["BJM1", "BJM2", "AVEF0", "AVEF1", "AVEF2", "TipPosition"]


def test_every_message_is_sent_once() -> None:
    sent = [0x200, 0x201, 0x202, 0x310, 0x311, 0x300, 0x301, 0x302]
    assert [one.key for one in shipped("forwarder").sent()] == [
        ("crane", can_id, False) for can_id in sent
    ]


# -- listening -------------------------------------------------------------------------------------


def test_who_listens_keeps_the_machine_without_what_answers_commands() -> None:
    before = shipped("canopen-forwarder")
    assert all(axis.feedback and axis.status_word for axis in before.axes.values())
    after = before.listening()
    assert after.listen_only
    assert list(after.axes) == list(before.axes)
    for axis in after.axes.values():
        assert (axis.feedback, axis.status_word, axis.sway_sensor) == (None, None, None)
        assert axis.status is before.axes[axis.name].status
    assert after.config.buses == before.config.buses
    sensed = shipped("forwarder-sensor")
    assert sensed.axes["slew"].sway_sensor is not None
    assert sensed.listening().axes["slew"].sway_sensor is None


def test_who_listens_keeps_a_node_of_j1939_where_it_reports(tmp_path: Path) -> None:
    file = machine_file(tmp_path, "j1939-forwarder")
    before = load_deployment(file)
    assert before.listening().config.buses == before.config.buses
    file.write_text(re.sub(r"(?m)^ *(status|identity): .*\n", "", file.read_text()))
    silent = load_deployment(file).listening()
    assert list(silent.config.buses) == ["crane"]
    bus = silent.config.buses["crane"]
    assert bus.j1939 is None
    assert bus == before.config.buses["crane"].model_copy(update={"j1939": None})


def test_without_readers_no_status_is_sent_and_all_else_stays(machine: Machine) -> None:
    before = machine.load()
    after = before.unreported
    assert (after.status, after.identity_status) == (None, None)
    assert [(a.status, a.status_ticks) for a in after.axes.values()] == [(None, 0)] * 3
    assert list(after.axes) == list(before.axes)
    assert [one.key[1] for one in after.sent()] == [0x200, 0x201, 0x202]
    assert before.unreported is after
    assert before.routing is before.routing
