"""The shipped gateway with pieces of its two files replaced."""

from pathlib import Path

import pytest

from canshaper.errors import ConfigError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.rigs.files import ROOT


def load(folder: Path, *changes: tuple[str, str], dbc: tuple[str, str] = ("", "")) -> Deployment:
    text = (ROOT / "config" / "gateway-forwarder.yaml").read_text()
    network = (ROOT / "dbc" / "forwarder.dbc").read_text("cp1252")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    assert dbc[0] in network
    (folder / "machine.dbc").write_text(network.replace(*dbc, 1), "cp1252")
    file = folder / "machine.yaml"
    file.write_text(text.replace("../dbc/forwarder.dbc", "machine.dbc"))
    return load_deployment(file)


def problems(folder: Path, *changes: tuple[str, str], dbc: tuple[str, str] = ("", "")) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load(folder, *changes, dbc=dbc)
    return [str(p).rpartition(f"{folder}/")[2] for p in caught.value.problems]


def j1939_gateway(folder: Path, *, source: str = "") -> Path:
    """A gateway of one joystick of J1939, to the file; ``source`` is the key with its address."""
    file = folder / "machine.yaml"
    file.write_text(f"""
version: 1
buses:
  near: {{ interface: socketcan, channel: vcan0 }}
  far: {{ interface: socketcan, channel: vcan1 }}
dbc: [{ROOT / "dbc" / "j1939-bjm-avc.dbc"}]
gateway: {{ between: [near, far], fallback: neutral }}
joysticks:
  left: {{ bus: near, message: BJM1, timeout_ms: 100, {source} enable: Button1 }}
axes:
  slew:
    command: {{ joystick: left, signal: XPosition, flags: {{ neutral: XNeutral,
      positive: XPositive, negative: XNegative }} }}
    valve: {{ bus: far, message: BJM1, signal: XPosition, timeout_ms: 200 }}
    filter: {{ kind: 'off' }}
""")
    return file
