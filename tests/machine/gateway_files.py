"""The shipped gateway with pieces of its two files replaced."""

from pathlib import Path

from canshaper.machine.deployment import Deployment
from tests.rigs.files import ROOT, Machine


def changed(folder: Path, *changes: tuple[str, str], dbc: tuple[str, str] = ("", "")) -> Machine:
    """The machine with the first of each of these pieces replaced."""
    machine = Machine(folder)
    machine.become("gateway-forwarder.yaml", "forwarder.dbc")
    for old, new in changes:
        machine.in_yaml(old, new)
    machine.in_dbc(*dbc)
    return machine


def load(folder: Path, *changes: tuple[str, str], dbc: tuple[str, str] = ("", "")) -> Deployment:
    return changed(folder, *changes, dbc=dbc).load()


def problems(folder: Path, *changes: tuple[str, str], dbc: tuple[str, str] = ("", "")) -> list[str]:
    return changed(folder, *changes, dbc=dbc).problems()


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
