import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from studies.crane.config import CraneConfig, GrappleData, load_crane
from studies.crane.dynamics import SwayDynamics
from studies.crane.kinematics import Kinematics
from studies.crane.tests.motion import SwayStates

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="session")
def shipped_path() -> Path:
    return ROOT / "studies" / "crane" / "forwarder.yaml"


@pytest.fixture(scope="session")
def crane(shipped_path: Path) -> CraneConfig:
    return load_crane(shipped_path)[0]


@pytest.fixture(scope="session")
def grapple(crane: CraneConfig) -> GrappleData:
    return crane.grapple


@pytest.fixture(scope="session")
def undamped(grapple: GrappleData) -> GrappleData:
    return grapple.model_copy(update={"c5_n_m_s_rad": 0.0, "c6_n_m_s_rad": 0.0})


@pytest.fixture(scope="session")
def kinematics(crane: CraneConfig) -> Kinematics:
    return Kinematics(crane.joints)


@pytest.fixture(scope="session")
def dynamics(grapple: GrappleData) -> SwayDynamics:
    return SwayDynamics(grapple)


@pytest.fixture(scope="session")
def states() -> SwayStates:
    """Two hundred random states of tip and grapple, angles to 60 deg."""
    return SwayStates.random(np.random.default_rng(5), 200)


@pytest.fixture(scope="session")
def reference() -> dict[str, Any]:
    """Numbers computed independently of this code for the corrected equations of the paper."""
    path = ROOT / "tests" / "data" / "paper_reference.json"
    loaded: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return loaded
