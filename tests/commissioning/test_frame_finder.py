"""Tools that listen find inputs as the daemon does: by group and source, at any priority."""

from pathlib import Path

import pytest

from canshaper.codec.frame import Frame
from canshaper.commissioning.identification.series import Commands
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput
from canshaper.recording.channels import InputFinder
from tests.rigs.files import ROOT, machine_file
from tests.rigs.j1939 import JOYSTICK, OTHER, OWN, bjm

MS = 1_000_000
PLAIN = ROOT / "config" / "forwarder.yaml"


@pytest.fixture
def any_source() -> Deployment:
    return load_deployment(ROOT / "config" / "j1939-forwarder.yaml")


@pytest.fixture
def one_source(tmp_path: Path) -> Deployment:
    """The left joystick is received from one address only."""
    joystick = "    message: BJM1\n"
    source = (joystick, f"{joystick}    source: {JOYSTICK}\n")
    return load_deployment(machine_file(tmp_path, "j1939-forwarder", source))


def finder(deployment: Deployment) -> InputFinder[BoundInput]:
    return InputFinder(deployment.config.buses, deployment.inputs())


@pytest.mark.parametrize("priority", [0, 3, 7])
def test_from_any_source_the_first_counts_until_it_is_silent_for_longer_than_its_timeout(
    any_source: Deployment, priority: int
) -> None:
    left, one = any_source.joysticks["left"], finder(any_source)
    timeout_ns = left.config.timeout_ms * MS
    assert one.find(bjm("BJM1", JOYSTICK, priority), 0) is left
    assert one.find(bjm("BJM1", OTHER, priority), MS) is None
    assert one.find(bjm("BJM1", JOYSTICK, priority), 2 * MS) is left
    assert one.find(bjm("BJM1", OTHER, priority), 2 * MS + timeout_ns) is None
    assert one.find(bjm("BJM1", OTHER, priority), 2 * MS + timeout_ns + 1) is left
    assert one.find(bjm("BJM1", OWN, priority), 9 * timeout_ns) is None


@pytest.mark.parametrize("priority", [0, 3, 7])
def test_from_one_source_no_other_counts(one_source: Deployment, priority: int) -> None:
    one = finder(one_source)
    assert one.find(bjm("BJM1", JOYSTICK, priority), 0) is one_source.joysticks["left"]
    assert one.find(bjm("BJM1", OTHER, priority), 1000 * MS) is None


def test_without_j1939_the_whole_identifier_counts() -> None:
    deployment = load_deployment(PLAIN)
    one, left = finder(deployment), deployment.joysticks["left"]
    _, can_id, extended = left.key
    assert one.find(Frame("crane", can_id, extended, b""), 0) is left
    assert one.find(Frame("crane", can_id, not extended, b""), 0) is None
    assert one.find(Frame("crane", can_id + 0x100, extended, b""), 0) is None
    assert one.find(Frame("boom", can_id, extended, b""), 0) is None


def test_inputs_behind_one_that_is_known_by_its_identifier_are_found(
    any_source: Deployment,
) -> None:
    """By group, and by identifier."""
    plain, left = load_deployment(PLAIN), any_source.joysticks["left"]
    inputs: list[BoundInput] = [plain.joysticks["left"], left, plain.joysticks["right"]]
    one = InputFinder(any_source.config.buses, inputs)
    for bound in (plain.joysticks["left"], plain.joysticks["right"]):
        assert one.find(Frame(*bound.key, b""), 0) is bound
    assert one.find(bjm("BJM1", JOYSTICK), 0) is left


def test_commands_of_a_log_are_those_of_the_joysticks(any_source: Deployment) -> None:
    commands = Commands(any_source)
    for n in range(100):
        frame = bjm("BJM1", JOYSTICK, 6, X=50.0 if n >= 50 else 0.0)
        commands.receive(n * 0.02, (frame.can_id, frame.extended), frame.data)
    command = commands.of("slew")
    assert command is not None
    assert [*command.speed[[0, 49, 50, 99]]] == [0.0, 0.0, 0.5, 0.5]
