"""``canshaper init --eds``: a deployment of CANopen nodes that then drives those very nodes."""

import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import canopen
import pytest

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.machine.binding import load_deployment
from tests.cli.eds_nodes import ANSWERS, LEFT, NEAR, SLEW, TILT, init
from tests.commissioning.nodes.eds_files import INCLINOMETER, JOYSTICK, U32, VALVE, write

TICK_NS = 20_000_000


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the design of robust shapers, which has tests of its own."""
    monkeypatch.setattr("canshaper.cli.verbs.init._designed", lambda *_: True)


@pytest.mark.usefixtures("quick")
def test_nodes_become_a_dbc_and_a_deployment(tmp_path: Path) -> None:
    result = init(tmp_path, ANSWERS)
    assert result.exit_code == 0, result.output
    deployment = load_deployment(tmp_path / "machine.yaml")
    config = deployment.config
    canopen_ = config.buses["crane"].canopen
    assert canopen_ is not None
    assert (canopen_.node, canopen_.master) == (1, True)
    nodes = {name: (node.id, node.heartbeat_ms) for name, node in canopen_.nodes.items()}
    assert nodes == {"left": (LEFT, 500), "slew": (SLEW, 250), "near": (NEAR, 250)}
    left = config.joysticks["left"]
    assert (left.message, left.node, left.enable) == ("left_TPDO1", "left", ["Buttons_1"])
    slew, near_far = config.axes["slew"], config.axes["near_far"]
    assert (slew.valve.timeout_ms, near_far.valve.timeout_ms) == (200, 250)
    assert slew.valve.cia408 is not None
    assert slew.valve.cia408.control == "DeviceControlWord"
    assert (slew.valve.cia408.status.message, slew.valve.cia408.status.timeout_ms) == (
        "slew_TPDO1",
        300,
    )
    for line in (
        "left: 1017h:0 = 200: ms between two heartbeats",
        "left: 1800h:5 = 20: ms between two TPDO1",
        "left: 6423h:0 = 1: analogue inputs are sent",
        "left: 1010h:1 = 0x65766173: it keeps this without power",
        "slew: 1400h:5 = 200: ms without RPDO1 after which it stops by itself",
        "near: 1400h:5 = 250: ms without RPDO1 after which it stops by itself",
    ):
        assert f"  To be set by SDO: {line}\n" in result.output
        assert f"# To be set by SDO: {line}\n" in (tmp_path / "machine.yaml").read_text()
    assert "TPDO2 0x290, off, event timer 0 ms: Slew" in result.output


class Loop(canopen.Network):
    """A bus without clock and threads: each frame goes to the daemon's controller at once."""

    def __init__(self, controller: Controller) -> None:
        super().__init__()
        self.controller = controller
        self.now_ns = 0

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        assert not remote
        self.controller.receive(Frame("crane", can_id, False, bytes(data)), self.now_ns)

    def tick(self) -> None:
        for frame in list(self.controller.tick(self.now_ns)):
            self.notify(frame.can_id, bytearray(frame.data), self.now_ns / 1e9)
        self.now_ns += TICK_NS


class Machine:
    """The three nodes, each of canopen and by the file that init has read."""

    def __init__(self, folder: Path) -> None:
        self.network = Loop(Controller(load_deployment(folder / "machine.yaml")))
        files = {LEFT: "joystick.eds", SLEW: "slew.dcf", NEAR: "near.eds"}
        self.nodes = {number: self._node(number, folder / file) for number, file in files.items()}
        self.axes = self.network.controller.axes

    def _node(self, number: int, file: Path) -> canopen.LocalNode:
        node = self.network.create_node(canopen.LocalNode(number, readable(file)))
        node.tpdo.read(from_od=True)
        node.rpdo.read(from_od=True)
        node.nmt._state = 127  # pre-operational, as after its boot
        return node

    def run(self, ticks: int, slew: int = 0, buttons: int = 1) -> None:
        """Every node sends its heartbeat and, operational, its PDOs; valves follow their words."""
        for _ in range(ticks):
            for number, node in self.nodes.items():
                state = 5 if node.nmt.state == "OPERATIONAL" else 127
                self.network.send_message(0x700 + number, bytes((state,)))
                if state == 5:
                    self._send(node, number, slew, buttons)
            self.network.tick()

    def _send(self, node: canopen.LocalNode, number: int, slew: int, buttons: int) -> None:
        if number == LEFT:
            node.tpdo[1]["Record 6401.Slew"].raw = slew
            node.tpdo[1]["Record 6000.Buttons"].raw = buttons
        else:
            node.tpdo[1][0x6041].raw = node.rpdo[1][0x6040].raw
        node.tpdo[1].transmit()

    def set_point(self, number: int) -> int:
        value: int = self.nodes[number].rpdo[1]["Record 6300.Set point"].raw
        return value


def readable(file: Path) -> str:
    """Return an EDS as canopen takes it: no empty numbers in DeviceInfo."""
    copy = file.with_name(f"plain-{file.name}.eds")
    copy.write_bytes(file.read_bytes().replace(b"VendorNumber=", b"VendorNumber=0"))
    return str(copy)


@pytest.mark.usefixtures("quick")
def test_the_deployment_drives_the_nodes_of_the_same_files(tmp_path: Path) -> None:
    assert init(tmp_path, ANSWERS).exit_code == 0
    machine = Machine(tmp_path)
    machine.run(60)
    assert {node.nmt.state for node in machine.nodes.values()} == {"OPERATIONAL"}
    assert machine.axes["slew"].axis.state.name == "READY"
    machine.run(300, slew=32767)
    assert machine.set_point(SLEW) == pytest.approx(0.4 * 16384, abs=2)  # reduced speed
    assert machine.set_point(NEAR) == 0
    machine.run(200)
    assert (machine.set_point(SLEW), machine.axes["slew"].axis.state.name) == (0, "READY")
    machine.run(300, slew=-32768)
    assert machine.set_point(SLEW) == pytest.approx(-0.4 * 16384, abs=2)
    machine.run(5, slew=-32768, buttons=0)
    assert machine.axes["slew"].axis.reason.name == "ENABLE_LOST"


@contextmanager
def on_bus(channel: str, files: Mapping[int, str]) -> Iterator[canopen.Network]:
    """Nodes with SDO servers on a bus of this process."""
    network = canopen.Network()
    network.connect(interface="virtual", channel=channel)
    try:
        for number, file in files.items():
            network.create_node(canopen.LocalNode(number, file))
        yield network
    finally:
        network.disconnect()


@pytest.mark.usefixtures("quick")
def test_parameters_are_set_by_sdo_read_before_and_after(tmp_path: Path) -> None:
    write(tmp_path / "joystick.eds", JOYSTICK)
    write(tmp_path / "valve.eds", VALVE)
    joystick, valve = readable(tmp_path / "joystick.eds"), readable(tmp_path / "valve.eds")
    with on_bus("eds-set", {LEFT: joystick, SLEW: valve, NEAR: valve}) as network:
        network[LEFT].sdo[0x6423].raw = 1  # somebody has set it before
        answers = ANSWERS + "CAN interface = eds-set\n"
        result = init(tmp_path, answers, "--interface", "virtual", "--set-by-sdo")
        assert result.exit_code == 0, result.output
        assert network[LEFT].sdo[0x1800][5].raw == 20
        assert network[SLEW].sdo[0x1400][5].raw == 200
        assert network[NEAR].sdo[0x1400][5].raw == 250
        assert network[LEFT].sdo[0x1010][1].raw == 0x65766173
    assert "left: 1800h:5 was 0, is 20" in result.output
    assert "left: 6423h:0 is 1 already" in result.output
    assert "left: 1010h:1: stored" in result.output


@pytest.mark.usefixtures("quick")
def test_a_node_that_is_not_there_or_refuses_is_one_line(tmp_path: Path) -> None:
    write(tmp_path / "joystick.eds", JOYSTICK)
    joystick = readable(tmp_path / "joystick.eds")
    with on_bus("eds-gone", {LEFT: joystick}):
        answers = ANSWERS + "CAN interface = eds-gone\n"
        result = init(tmp_path, answers, "--interface", "virtual", "--set-by-sdo")
    assert result.exit_code == 1
    last = result.output.splitlines()[-1]
    assert last == "slew: 1400h:5: expected it to take 200, got No SDO response received"
    assert (tmp_path / "machine.yaml").exists()


@pytest.mark.usefixtures("quick")
def test_a_node_that_keeps_another_value_is_one_line(tmp_path: Path) -> None:
    write(tmp_path / "joystick.eds", JOYSTICK)
    with on_bus("eds-other", {LEFT: readable(tmp_path / "joystick.eds")}) as network:
        slowest = {(0x1800, 5): 50}
        network[LEFT].add_read_callback(lambda index, subindex, **_: slowest.get((index, subindex)))
        answers = ANSWERS + "CAN interface = eds-other\n"
        result = init(tmp_path, answers, "--interface", "virtual", "--set-by-sdo")
    assert result.exit_code == 1
    assert result.output.splitlines()[-1] == "left: 1800h:5: expected 20 afterwards, got 50"


@pytest.mark.usefixtures("quick")
def test_on_a_real_bus_nothing_is_set_unless_it_was_confirmed(tmp_path: Path) -> None:
    result = init(tmp_path, ANSWERS + "CAN interface = can_none\n", "--set-by-sdo")
    assert result.exit_code == 0, result.output
    assert "To be set by SDO" in result.output
    shutil.rmtree(tmp_path)
    tmp_path.mkdir()
    yes = "CAN interface = can_none\nWrite 6 parameters = yes\n"
    result = init(tmp_path, ANSWERS + yes, "--set-by-sdo")
    assert result.exit_code == 3
    assert "bus crane: cannot open socketcan channel can_none: " in result.output


@pytest.mark.usefixtures("quick")
def test_an_inclinometer_is_offered_as_a_sway_sensor(tmp_path: Path) -> None:
    tilt = write(tmp_path / "tilt.eds", INCLINOMETER)
    answers = f"tilt: node id = {TILT}\nslew: sway sensor = tilt_TPDO1.SlopeLateral16\n"
    result = init(tmp_path, ANSWERS + answers, "--eds", str(tilt))
    assert result.exit_code == 0, result.output
    config = load_deployment(tmp_path / "machine.yaml").config
    sensor = config.axes["slew"].sway_sensor
    assert sensor is not None
    assert (sensor.message, sensor.node, sensor.timeout_ms) == ("tilt_TPDO1", "tilt", 80)


@pytest.mark.usefixtures("quick")
def test_a_drive_without_cia_408_is_watched_by_its_heartbeats(tmp_path: Path) -> None:
    drive = VALVE | {0x1000: ("Device type", U32, "0x00020192")}  # CiA 402
    result = init(tmp_path, ANSWERS, near=drive)
    assert result.exit_code == 0, result.output
    config = load_deployment(tmp_path / "machine.yaml").config
    slew, near_far = config.axes["slew"].valve, config.axes["near_far"].valve
    assert slew.cia408 is not None
    assert (slew.node, slew.cia408.node) == (None, "slew")
    assert (near_far.node, near_far.cia408) == ("near", None)
