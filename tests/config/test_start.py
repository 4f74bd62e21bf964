"""What a start of the daemon does not do with the schema."""

import subprocess
import sys

from canshaper.config.schema import AxisConfig, DeploymentConfig
from canshaper.config.uncertainty import Accept

START = """
import inspect
inspect.findsource = None
from canshaper.daemon.daemon import Daemon
from canshaper.machine.binding import load_deployment
from canshaper.shipped import deployment_path
load_deployment(deployment_path("forwarder-robust.yaml"))
"""


def test_a_start_does_not_read_its_own_source() -> None:
    subprocess.run([sys.executable, "-c", START], check=True)


def test_a_key_says_what_it_is_for() -> None:
    assert DeploymentConfig.description("tick") == (
        "Where the ticks are; without it where the daemon began."
    )
    assert DeploymentConfig.description("dbc") == "DBC files, relative to this file"
    assert AxisConfig.description("status") == "Message with the status of the axis."
    assert Accept.description("residual_deg_p99") == (
        "most of the p99 quantile: largest swing that is left, deg"
    )
    assert AxisConfig.description("wrong") is None
