"""The command line: exit codes, buses by option, help, and how it ends."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from canshaper import __version__
from canshaper.cli.common import loader
from canshaper.errors import ConfigError
from tests.cli.invocation import SHIPPED, invoke
from tests.rigs.files import ROOT, machine_file


@pytest.fixture
def two_buses(tmp_path: Path) -> Path:
    bus = "  crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }\n"
    boom = bus.replace("crane", "boom").replace("vcan0", "vcan1")
    return machine_file(tmp_path, SHIPPED, (bus, bus + boom))


def test_run_of_a_broken_file_opens_no_bus(broken: Path, opened: list[dict[str, Any]]) -> None:
    result = invoke("run", str(broken))
    assert result.exit_code == 2
    assert "tick_ms: expected a whole number, 1 to 50 ms, got 0" in result.stderr
    assert "kind: expected one of 'off', " in result.stderr
    assert ", got 'x'" in result.stderr
    assert opened == []


def test_run_without_its_bus_says_which(opened: list[dict[str, Any]]) -> None:
    result = invoke("run", str(SHIPPED), "--channel", "can7")
    assert result.exit_code == 3
    assert "bus crane: cannot open socketcan channel can7: " in result.stderr
    result = invoke("run", str(SHIPPED), "--interface", "virtual", "--channel", "can7")
    assert "bus crane: cannot open virtual channel can7: no such device" in result.stderr
    assert [(o["interface"], o["channel"]) for o in opened] == [("virtual", "can7")]


def test_bus_options(two_buses: Path) -> None:
    buses = loader(str(SHIPPED), "virtual", ["x"])().config.buses
    assert (buses["crane"].interface, buses["crane"].channel) == ("virtual", "x")
    buses = loader(str(two_buses), None, ["boom=can1", "crane=can0"])().config.buses
    assert {n: b.channel for n, b in buses.items()} == {"crane": "can0", "boom": "can1"}


def test_a_bus_is_shared_over_the_network_only_where_that_is_said(tmp_path: Path) -> None:
    """Sharing in a file holds for its own interface alone."""
    bus = "{ interface: socketcan, channel: vcan0, bitrate: 250000 }"
    other = "{ interface: udp_multicast, channel: 239.1.2.3, network: true }"
    shared = machine_file(tmp_path, SHIPPED, (bus, other))
    multicast = (str(shared), "udp_multicast")
    assert loader(str(shared))().config.buses["crane"].network
    assert loader(str(shared), None, ["239.1.2.4"])().config.buses["crane"].network
    assert not loader(*multicast)().config.buses["crane"].network
    assert loader(*multicast, network=True)().config.buses["crane"].network
    assert not loader(str(SHIPPED), "udp_multicast", ["239.1.2.3"])().config.buses["crane"].network
    says = "--network: expected udp_multicast only, got the interface socketcan"
    with pytest.raises(ConfigError, match=says):
        loader(str(SHIPPED), network=True)()


@pytest.mark.parametrize(
    ("channels", "says"),
    [
        (["x"], "expected NAME=CHANNEL with one of crane, boom, got 'x'"),
        (["jib=x"], "expected NAME=CHANNEL with one of crane, boom, got 'jib=x'"),
        (["crane=vcan1"], "expected a channel for each of crane, boom, got one for two of them"),
        (
            ["crane=a", "boom=a"],
            "expected a channel for each of crane, boom, got one for two of them",
        ),
    ],
)
def test_bus_options_that_do_not_fit(two_buses: Path, channels: list[str], says: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(f"command line: --channel: {says}")):
        loader(str(two_buses), None, channels)()


# -- the command itself ----------------------------------------------------------------------------


def test_version() -> None:
    result = invoke("--version")
    assert (result.exit_code, result.stdout) == (0, f"canshaper {__version__}\n")


@pytest.mark.parametrize("arguments", [["start"], ["check"], ["check", "--fast", "x"], ["run"]])
def test_wrong_use_is_an_error_without_a_traceback(arguments: list[str]) -> None:
    result = invoke(*arguments)
    assert result.exit_code == 2
    assert "Error: " in result.stderr
    assert isinstance(result.exception, SystemExit)


@pytest.mark.parametrize("ends", ["SystemExit(0)", "KeyboardInterrupt"])
def test_the_end_of_python_does_not_look_through_what_was_loaded(ends: str) -> None:
    """Its last collection of garbage took seconds after Ctrl-C, with CasADi and SciPy loaded."""
    code = f"""
import gc
from canshaper import __main__
from canshaper.cli import app
def end():
    raise {ends}
app.main = end
try:
    __main__.main()
except SystemExit as error:
    print(error.code, gc.get_freeze_count() > 1000)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout == f"{0 if '0' in ends else 130} True\n"
