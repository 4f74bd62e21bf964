"""The crane file: what it accepts, and how it says what is wrong."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from canshaper.errors import ConfigError
from canshaper_sim.grapple import Grapple
from studies.crane.config import CraneConfig, load_crane


def problems(path: Path, text: str) -> list[str]:
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_crane(path)
    return [str(p).replace(str(path), path.name) for p in caught.value.problems]


def test_the_shipped_crane_carries_the_simulated_grapple(crane: CraneConfig) -> None:
    assert Grapple(**crane.grapple.model_dump()) == Grapple()
    assert crane.name == "medium forwarder crane"


# What is changed in the shipped file, into what, where that is said to be wrong, and how.
FAULTS = [
    (
        "max_m: 3.4",
        "max_m: long",
        "max_m: 3.4",
        "extension.max_m: expected 0 to 20 m, got 'long'",
    ),
    ("m2_kg: 300", "m2_kg: 0", "m2_kg", "grapple.m2_kg: expected 1 to 100000 kg, got 0"),
    ("m2_kg: 300", "m2_kg: .nan", "m2_kg", "grapple.m2_kg: expected 1 to 100000 kg, got nan"),
    ("  m2_kg: 300", "  #", "grapple:", "grapple.m2_kg: missing: mass of grapple and load (kg)"),
    (
        "  m2_kg: 300",
        "  m3_kg: 1\n  m2_kg: 300",
        "m2_kg",
        "grapple.m3_kg: expected one of the keys l1_m, l2_m, m1_kg, m2_kg, c5_n_m_s_rad, ",
    ),
    (
        "max_deg: 80",
        "max_deg: -30",
        "lift:",
        "joints.lift: min_deg: expected less than max_deg, got -20",
    ),
    (
        "max_m: 3.4",
        "max_m: 0",
        "extension:",
        "joints.extension: min_m: expected less than max_m, got 0",
    ),
    (
        "alpha_deg: -90",
        "alpha_deg: 90",
        "joints:",
        "extension.alpha_deg: expected -90 (Eq. 3), got 90",
    ),
    (
        "90, d_m: 0,",
        "90, d_m: 0.1,",
        "joints:",
        "lift.d_m: expected 0 (boom in one plane, Eq. 3), got 0.1",
    ),
    (
        "3.7, alpha_deg: 0, d_m: 0",
        "3.7, alpha_deg: 0, d_m: 1",
        "joints:",
        "knuckle.d_m: expected 0 (boom in one plane, Eq. 3), got 1",
    ),
    (
        "{ a_m: 0, alpha",
        "{ a_m: 0.5, alpha",
        "joints:",
        "slew.a_m: expected 0 (boom in one plane, Eq. 3), got 0.5",
    ),
    (
        "2.35, theta_deg: 0",
        "2.35, theta_deg: 5",
        "joints:",
        "extension.theta_deg: expected 0 (boom in one plane, Eq. 3), got 5",
    ),
]


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_reported_with_file_and_line(
    shipped_path: Path, tmp_path: Path, fault: tuple[str, str, str, str]
) -> None:
    old, new, place, message = fault
    text = shipped_path.read_text(encoding="utf-8")
    assert text.count(old) == 1
    (problem,) = problems(tmp_path / "crane.yaml", text.replace(old, new))
    line = 1 + text[: re.search(rf"(^|, )\s*{place}", text, re.MULTILINE).end()].count("\n")
    assert problem.startswith(f"crane.yaml:{line}: ")
    assert message in problem


def test_all_faults_are_reported_at_once(tmp_path: Path) -> None:
    reported = problems(tmp_path / "crane.yaml", "name: 7\nwheels: 8\n")
    assert sorted(f.split(": ")[1] for f in reported) == ["grapple", "joints", "name", "wheels"]
    assert (
        "crane.yaml:2: wheels: expected one of the keys name, joints, grapple, got an unknown one"
        in reported
    )


@pytest.mark.slow
def test_the_daemon_does_not_load_casadi() -> None:
    code = "import sys, canshaper.daemon.daemon; sys.exit('casadi' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
