"""A drive that no one listens to: fewer frames on the bus, the same at every valve."""

from dataclasses import replace

import pytest

from canshaper.codec.frame import Frame
from canshaper.design.lockstep import Simulation
from canshaper.machine.binding import load_deployment
from canshaper_sim.axes import ALL_AXES
from canshaper_sim.crane import CraneParameters
from canshaper_sim.cranes import cranes, one_crane
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import random_script
from canshaper_sim.plant import PlantNode
from canshaper_sim.strokes import Script
from tests.faults.shipped import NAMES
from tests.rigs.files import CONFIG


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_valves_and_crane_do_the_same_whether_anybody_listens(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    deployment = load_deployment(CONFIG / f"{name}.yaml")
    crane = next(iter(cranes(deployment)), None)
    driven = one_crane(deployment, crane) if crane else deployment
    script = random_script(3, 8.0, [axis for axis in ALL_AXES if axis in driven.axes])
    sent: list[Frame] = []
    receive = PlantNode.receive

    statuses = {*deployment.routing.sent} - {*deployment.routing.valves}

    def received(self: PlantNode, frame: Frame) -> None:
        if frame[:3] not in statuses:
            sent.append(frame)
        receive(self, frame)

    monkeypatch.setattr(PlantNode, "receive", received)
    received: list[Frame] = []
    drives = []
    for on_frame in (lambda frame, _time_s: received.append(frame), None):
        sent.clear()
        again = load_deployment(deployment.path)  # with alive counters that begin again
        simulation = Simulation(again, script, on_frame, crane=crane)
        states = [(time_ms, simulation.plant.crane.state) for time_ms in simulation.ticks()]
        drives.append(([*sent], states))
    assert drives[0] == drives[1]
    assert {*sent} < {*received}


def test_no_status_is_sent_where_no_one_listens() -> None:
    deployment = load_deployment(CONFIG / "forwarder-robust.yaml")
    script = Script("still", (), 1.0)
    sent: list[Frame] = []
    simulation = Simulation(deployment, script, lambda frame, _time_s: sent.append(frame))
    for _ in simulation.ticks():
        pass
    statuses = {axis.status.message.key for axis in deployment.axes.values() if axis.status}
    assert statuses
    assert statuses <= {frame[:3] for frame in sent}
    unreported = deployment.unreported.routing
    assert {*unreported.sent} == {*deployment.routing.valves}
    assert unreported.valves == deployment.routing.valves


def test_a_plant_without_listeners_sends_only_what_the_controller_receives() -> None:
    plain = load_deployment(CONFIG / "forwarder.yaml")
    radius = load_deployment(CONFIG / "forwarder-robust.yaml")
    sent = {
        one.path.name: [frame.can_id for frame in PlantNode(one, listeners=False).feedback()]
        for one in (plain, radius)
    }
    position = radius.messages.find("TipPosition")
    assert not isinstance(position, str)
    assert sent == {"forwarder.yaml": [], "forwarder-robust.yaml": [position[1].frame_id]}


@pytest.mark.parametrize("tick_ms", [5, 10, 20, 35, 100])
def test_every_joystick_frame_of_a_drive_comes_in_its_tick(tick_ms: int) -> None:
    deployment = load_deployment(CONFIG / "forwarder.yaml")
    script = Script("still", (), 5.0)
    in_ticks, at_once = JoystickNode(deployment, script), JoystickNode(deployment, script)
    due = {ms: at_once.frames(ms) for ms in range(0, 1001)}
    for time_ms in range(0, 1001, tick_ms):
        since = range(max(0, time_ms - tick_ms + 1), time_ms + 1)
        assert in_ticks.frames_of_tick(time_ms, tick_ms) == [f for ms in since for f in due[ms]]


def test_loads_hang_from_their_time_on() -> None:
    deployment = load_deployment(CONFIG / "forwarder.yaml")
    empty = CraneParameters().grapple
    full = replace(empty, m2_kg=900.0)
    script = Script("still", (), 3.0)
    simulation = Simulation(deployment, script, loads=((1.0, full), (2.0, empty)))
    hung = [(ms, simulation.plant.crane.parameters.grapple) for ms in simulation.ticks()]
    assert {ms for ms, grapple in hung if grapple == full} == {*range(1000, 2000, 20)}
