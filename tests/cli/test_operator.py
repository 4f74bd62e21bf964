"""``canshaper operator`` as a process: a script that is interrupted was not played."""

import os
import signal
import subprocess
import sys

import pytest

from canshaper.bus.multicast import LocalMulticastBus
from tests.rigs.files import ROOT

pytestmark = pytest.mark.processes

GROUP = f"239.79.{os.getpid() // 256 % 256}.{os.getpid() % 256}"


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_script_is_not_exit_0(number: int) -> None:
    command = [sys.executable, "-m", "canshaper", "operator", "config/forwarder.yaml"]
    options = ["--interface", "udp_multicast", "--channel", GROUP]
    with LocalMulticastBus(GROUP) as bus:
        process = subprocess.Popen(
            [*command, *options], cwd=ROOT, stderr=subprocess.PIPE, text=True
        )
        assert bus.recv(60.0)
        process.send_signal(number)
        _, errors = process.communicate(timeout=60.0)
    assert (process.returncode, errors) == (130, "interrupted\n")
