"""Work on the schema that a start of the daemon avoids."""

import subprocess
import sys

import pytest

from canshaper.config.desk import Accept
from canshaper.config.inputs import InputSection
from canshaper.config.limits import Limits
from canshaper.config.schema import AxisSection, DeploymentConfig, FeedbackSection

START = """
import inspect
inspect.findsource = None
from canshaper.daemon.daemon import Daemon
from canshaper.machine.binding import load_deployment
from canshaper.shipped import deployment_path
load_deployment(deployment_path("forwarder-robust.yaml"))
"""


@pytest.mark.slow
def test_a_start_does_not_read_its_own_source() -> None:
    subprocess.run([sys.executable, "-c", START], check=True)


def test_a_key_says_what_it_is_for() -> None:
    assert DeploymentConfig.description("tick") == ("Joystick that the ticks follow.")
    assert DeploymentConfig.description("dbc") == "DBC files, relative to this file"
    assert AxisSection.description("slewing") == (
        "Full speed in angle and radius of an axis that slews."
    )
    assert Accept.description("residual_deg_p99") == (
        "most of the p99 quantile: largest swing that is left later than 2.5 s after the last"
        " release, or than the longest tail_s where that is more than 5 s, deg"
    )
    assert AxisSection.description("wrong") is None


def test_all_that_is_said_of_a_key_is_its_own() -> None:
    assert Limits.description("max_pct") == "fastest output (% of full speed)"
    assert Limits.documentation("max_pct") == (
        "Fastest output; the filter works at reduced speed too."
    )
    joystick, valve = (
        InputSection.documentation("timeout_ms"),
        FeedbackSection.documentation("timeout_ms"),
    )
    assert joystick == "Age at which it is lost; of a joystick at least two cycles and two ticks."
    assert valve == "age at which it counts as lost (ms)"
