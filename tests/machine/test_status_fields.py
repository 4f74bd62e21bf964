"""Fields of status messages: one declaration is enough, and no machine needs a new one."""

import math
import pickle
from typing import Any

import pytest

from canshaper.codec import status
from canshaper.codec.status import StatusField
from canshaper.commissioning.monitor.state import Monitor
from canshaper.commissioning.monitor.view import screen
from canshaper.controller.controller import Controller
from canshaper.errors import ConfigError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.recording.listen import ReceivedFrame
from tests.rigs.files import ROOT, Machine, read

ACTIVE_SET = "SG_ ActiveSet : 4|4@1+ (1,0) [0|15]"
AT_REST = "SG_ AtRest : 4|1@1+ (1,0) [0|1]"
FIELD: StatusField[Any] = StatusField("AtRest", lambda one: one.axis.neutral, int)


def shown(deployment: Deployment) -> tuple[dict[str, object], str]:
    """Status of the first axis as a monitor decodes and shows it."""
    monitor = Monitor(deployment)
    for frame in Controller(deployment).tick(0):
        monitor.receive(ReceivedFrame(0, frame.bus, "can0", *frame[1:], ""))
    return monitor.history.axes["slew"].values, screen(monitor, 0, 120, 40, plain=True).plain


def test_a_field_added_from_outside_is_sent_decoded_and_shown(machine: Machine) -> None:
    machine.in_dbc(ACTIVE_SET, AT_REST)
    status.AXIS_STATUS.append(FIELD)
    try:
        values, text = shown(machine.load())
    finally:
        status.AXIS_STATUS.remove(FIELD)
    assert values["AtRest"] == 1
    assert "ActiveSet" not in values
    assert "AtRest 1" in text


@pytest.mark.parametrize(
    "name",
    [path.name for path in sorted((ROOT / "config").glob("*.yaml")) if "axes:" in path.read_text()],
)
def test_its_absence_in_a_dbc_refuses_no_machine(name: str) -> None:
    status.AXIS_STATUS.append(FIELD)
    try:
        deployment = load_deployment(ROOT / "config" / name)
    finally:
        status.AXIS_STATUS.remove(FIELD)
    for axis in deployment.axes.values():
        assert axis.status is None or "AtRest" not in [one.name for one in axis.status.fields]


def test_a_required_field_that_is_missing_is_named(machine: Machine) -> None:
    machine.in_dbc("SG_ PredictedSway", "SG_ Prediction")
    with pytest.raises(ConfigError, match="SlewStatus: lacks the signals PredictedSway"):
        machine.load()


def test_an_optional_field_that_cannot_carry_a_number_is_refused(machine: Machine) -> None:
    machine.in_dbc(ACTIVE_SET, ACTIVE_SET.replace("(1,0)", "(0,0)"))
    with pytest.raises(ConfigError, match="ActiveSet: expected an integer signal with a scale"):
        machine.load()


def test_every_axis_has_every_field() -> None:
    """A field that an axis lacks would end the daemon at its first status message."""
    controller = Controller(read(ROOT / "config/forwarder-sensor.yaml"))
    for axis in controller.axes.values():
        assert all(math.isfinite(field.encode(axis)) for field in status.AXIS_STATUS)
    for field in status.AXIS_STATUS:
        assert field.meaning


def test_every_field_is_the_same_after_a_reload() -> None:
    """The deployment is read in a process of its own, and comes back as bytes."""
    for field in (*status.AXIS_STATUS, *status.SERVICE_STATUS, *status.IDENTITY, *status.AIM):
        assert repr(pickle.loads(pickle.dumps(field))) == repr(field)


def test_a_status_that_is_multiplexed_or_missing(machine: Machine) -> None:
    line = "    status: { bus: crane, message: SlewStatus }\n"
    machine.in_yaml(line, "")
    axis = machine.load().axes["slew"]
    assert (axis.status, axis.status_ticks) == (None, 0)
    machine.in_yaml("    slewing:", f"{line}    slewing:")
    more = ' SG_ More m1 : 48|16@1- (1,0) [0|0] "" PLANT\n SG_ PredictedSway m0 :'
    machine.in_dbc("SG_ ActiveSet :", "SG_ ActiveSet M :")
    machine.in_dbc(" SG_ PredictedSway :", more)
    reason = "SlewStatus is multiplexed; without multiplexor nothing can be sent in it"
    with pytest.raises(ConfigError, match=reason):
        machine.load()
