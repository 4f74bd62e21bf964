"""Machines that several tests of the controller drive."""

from pathlib import Path

import pytest

from tests.controller.adjustable import CONTROL, STATUS
from tests.controller.cab import LEFT, SEAT_DBC, SWITCHES
from tests.rigs.canopen import CanopenRig, write_variant
from tests.rigs.files import Machine, machine_file
from tests.rigs.forwarder import Make, Rig
from tests.rigs.j1939 import Rig as J1939Rig


@pytest.fixture
def switched(machine: Machine) -> Machine:
    """The left joystick needs seat, door, mode and the switch of the right one besides its own."""
    machine.in_dbc("BO_ 512 SlewCommand", SEAT_DBC + "BO_ 512 SlewCommand")
    cycle = 'BA_ "GenMsgCycleTime" BO_ 272 20;\n'
    machine.in_dbc(
        cycle, cycle + cycle.replace("272 20", "288 100") + cycle.replace("272 20", "289 100")
    )
    machine.in_yaml("axes:\n", SWITCHES)
    machine.in_yaml(LEFT, "enable: [Enable, seat, door, mode, right.Enable]")
    return machine


@pytest.fixture
def canopen(tmp_path: Path) -> CanopenRig:
    return CanopenRig(write_variant(tmp_path)).ready()


@pytest.fixture
def j1939(tmp_path: Path) -> J1939Rig:
    rig = J1939Rig(machine_file(tmp_path, "j1939-forwarder")).claimed()
    rig.run(5)
    return rig


@pytest.fixture
def make(changed_rig: Make) -> Make:
    def made(yaml: dict[str, str] | None = None) -> Rig:
        return changed_rig({STATUS: STATUS + CONTROL} | (yaml or {}))

    return made
