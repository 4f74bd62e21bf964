"""The controller of the shipped machine of CANopen, with its nodes."""

import pytest

from tests.rigs.canopen import CanopenRig


@pytest.fixture
def rig() -> CanopenRig:
    return CanopenRig()
