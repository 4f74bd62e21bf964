"""The simulated joysticks: what they send is right for every protection a deployment may ask."""

from collections.abc import Callable
from pathlib import Path

import pytest
from crccheck.crc import Crc8Autosar

from canshaper.checksums.kinds import CHECKSUMS
from canshaper.controller.controller import Controller
from canshaper.design.lockstep import drive
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shaping.states import State
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import SCRIPTS, random_script
from tests.codec.checksum_reference import PLACES, with_checksum
from tests.rigs.files import ROOT

SCRIPT = random_script(1)

RESET = ' SG_ Reset : 36|2@1+ (1,0) [0|1] "" SHAPER\n'
COUNTER = "    alive_counter: AliveCounter\n"
LAST = "status: { bus: crane, message: ShaperStatus }"
STOP = (
    "emergency_stop: { bus: crane, message: Stop, signal: Pressed, timeout_ms: 200,"
    " alive_counter: Count, checksum: { signal: Check, kind: crc8_autosar } }\n"
)
STOP_DBC = (
    "BO_ 64 Stop: 3 JOYSTICKS\n"
    ' SG_ Pressed : 0|2@1+ (1,0) [0|3] "" SHAPER\n'
    ' SG_ Count : 8|4@1+ (1,0) [0|15] "" SHAPER\n'
    ' SG_ Check : 16|8@1+ (1,0) [0|255] "" SHAPER\n\n'
    "BO_ 512 SlewCommand"
)

Make = Callable[..., Deployment]


@pytest.fixture
def machine(tmp_path: Path) -> Make:
    """The shipped machine with its joysticks protected, and with an emergency stop."""

    def make(kind: str = "xor", cycles: tuple[int, int, int] = (20, 20, 50)) -> Deployment:
        text = (ROOT / "config" / "forwarder.yaml").read_text(encoding="utf-8")
        text = text.replace("../dbc/forwarder.dbc", "machine.dbc").replace(LAST, STOP + LAST)
        check = f"    checksum: {{ signal: Check, kind: {kind} }}\n"
        text = text.replace(COUNTER, COUNTER + check)
        dbc = (ROOT / "dbc" / "forwarder.dbc").read_text(encoding="cp1252")
        check = f' SG_ Check : {PLACES[CHECKSUMS[kind].bits]} (1,0) [0|1] "" SHAPER\n'
        dbc = dbc.replace(RESET, RESET + check).replace("BO_ 512 SlewCommand", STOP_DBC)
        left, right, stop = (f'BA_ "GenMsgCycleTime" BO_ {n} ' for n in (272, 273, 64))
        dbc = dbc.replace(f"{left}20;", f"{left}{cycles[0]};\n{stop}{cycles[2]};")
        dbc = dbc.replace(f"{right}20;", f"{right}{cycles[1]};")
        (tmp_path / "machine.yaml").write_text(text, encoding="utf-8")
        (tmp_path / "machine.dbc").write_text(dbc, encoding="cp1252")
        return load_deployment(tmp_path / "machine.yaml")

    return make


def frames(node: JoystickNode, milliseconds: int) -> dict[int, list[tuple[int, bytes]]]:
    """(time in ms, data) of every frame by id, as the node is called in real time."""
    by_id: dict[int, list[tuple[int, bytes]]] = {}
    for time_ms in range(0, milliseconds, node.cycle_ms):
        for frame in node.frames(time_ms):
            by_id.setdefault(frame.can_id, []).append((time_ms, frame.data))
    return by_id


@pytest.mark.parametrize("kind", CHECKSUMS)
def test_every_frame_has_the_next_counter_and_its_checksum(machine: Make, kind: str) -> None:
    sent = frames(JoystickNode(machine(kind), SCRIPT), 20_000)
    for can_id, modulus in ((0x110, 256), (0x40, 16)):
        counter = 7 if can_id == 0x110 else 1
        counts = [data[counter] for _, data in sent[can_id]]
        assert len(counts) > modulus  # it went round
        assert counts == [(counts[0] + i) % modulus for i in range(len(counts))]
        for _, data in sent[can_id]:
            if can_id == 0x110:
                assert data == with_checksum(kind, CHECKSUMS[kind].bits, can_id, data)
            else:
                assert data[2] == Crc8Autosar.calc(data[:2])


@pytest.mark.parametrize("cycles", [(20, 20, 50), (20, 50, 20), (10, 20, 100), (30, 20, 50)])
def test_every_message_keeps_its_cycle(machine: Make, cycles: tuple[int, int, int]) -> None:
    sent = frames(JoystickNode(machine(cycles=cycles), SCRIPT), 600)
    for can_id, cycle_ms in zip((0x110, 0x111, 0x40), cycles, strict=True):
        assert [time_ms for time_ms, _ in sent[can_id]] == list(range(0, 600, cycle_ms))


def test_the_emergency_stop_is_never_pressed(machine: Make) -> None:
    assert {data[0] for _, data in frames(JoystickNode(machine(), SCRIPT), 30_000)[0x40]} == {0}


@pytest.mark.parametrize("bypass", [False, True])
def test_a_controller_takes_every_frame(machine: Make, bypass: bool) -> None:
    deployment = machine("crc8_sae_j1850")
    controller = Controller(deployment)
    node = JoystickNode(deployment, SCRIPT, bypass=bypass)
    states = set()
    for time_ms in range(0, 10_000, 20):
        for earlier in range(max(0, time_ms - 10), time_ms + 1, node.cycle_ms):
            for frame in node.frames(earlier):
                controller.receive(frame, time_ms * 1_000_000)
        list(controller.tick(time_ms * 1_000_000))
        states |= {control.axis.state for control in controller.axes.values()}
    assert states == {State.READY, State.BYPASS_ON if bypass else State.ACTIVE}
    assert controller.counters.last_fault == 0


def test_protection_changes_nothing_of_the_drive(machine: Make) -> None:
    script = random_script(2, 10.0)
    plain = drive(load_deployment(ROOT / "config" / "forwarder.yaml"), script)
    assert drive(machine("crc8_autosar"), script) == plain


def test_no_script_holds_a_joystick_for_so_long_that_it_counts_as_broken() -> None:
    """stuck_s is 20 s by default; half of that leaves room."""
    for script in (*SCRIPTS.values(), *(random_script(seed) for seed in range(20))):
        for axis in script.axes:
            last, since_s = 0.0, 0.0
            for tick in range(round(script.duration_s * 50)):
                joystick = script.command(axis, tick / 50)
                if joystick != last:
                    last, since_s = joystick, tick / 50
                assert not joystick or tick / 50 - since_s < 10.0, (script.name, axis)
