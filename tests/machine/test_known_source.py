"""Messages of J1939 that need a known source address."""

import re
from pathlib import Path

import pytest

from canshaper.errors import ConfigError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.rigs.forwarder import ROOT

BJM3 = "bus: crane, message: BJM3, timeout_ms: 100"
SWITCH = f"switches:\n  seat: {{ {BJM3}, signal: Button1 }}\n\naxes:\n"
STOP = f"emergency_stop: {{ {BJM3}, signal: Button1 }}\n\naxes:\n"
RADIUS = (
    f"motion: {{ crane: {{ slew: slew, near_far: near_far,"
    f" radius: {{ {BJM3}, signal: XPosition }} }} }}\n\naxes:\n"
)


def load(folder: Path, *changes: tuple[str, str]) -> Deployment:
    """The shipped machine of J1939 with texts replaced."""
    text = (ROOT / "config" / "j1939-forwarder.yaml").read_text(encoding="utf-8")
    for old, new in (*changes, ("../dbc/j1939-bjm-avc.dbc", "machine.dbc")):
        assert old in text
        text = text.replace(old, new, 1)
    dbc = (ROOT / "dbc" / "j1939-bjm-avc.dbc").read_text(encoding="cp1252")
    for name in ("Button6", "Button7", "Button8"):  # a whole byte for Button5 of BJM1
        for row in (" SG_", "VAL_ 2365445886"):
            dbc = re.sub(f"{row} {name} .*\n", "", dbc, count=1)
    dbc = dbc.replace("Button5 : 54|2@1+", "Button5 : 48|8@1+", 1)
    start = dbc.index("BJM3: 8")
    position = 'XPosition : 6|10@1+ (0.1,0) [0|100] "%"'
    third = dbc[start:].replace(position, position.replace("%", "m"), 1)
    (folder / "machine.dbc").write_text(dbc[:start] + third, encoding="cp1252")
    file = folder / "machine.yaml"
    file.write_text(text, encoding="utf-8")
    return load_deployment(file)


def problems(folder: Path, *changes: tuple[str, str]) -> list[str]:
    """Problems of the changed machine, without file and line."""
    with pytest.raises(ConfigError) as caught:
        load(folder, *changes)
    return [
        str(one).rpartition(f"{folder}/")[2].partition(": ")[2] for one in caught.value.problems
    ]


@pytest.mark.parametrize(
    ("section", "enable", "place", "what"),
    [
        (SWITCH, "[Button1, seat]", "switches.seat", "a switch"),
        (STOP, "Button1", "emergency_stop", "the emergency stop"),
        (RADIUS, "Button1", "motion.crane.radius", "the radius"),
    ],
)
def test_what_stops_or_scales_a_motion_has_a_known_source(
    tmp_path: Path, section: str, enable: str, place: str, what: str
) -> None:
    enabled = ("enable: Button1", f"enable: {enable}")
    assert problems(tmp_path, ("axes:\n", section), enabled) == [
        f"{place}.source: missing: in the DBC BJM3 may come from any source address; {what}"
        " needs a known one"
    ]


def test_a_checksum_of_the_id_needs_a_known_source(tmp_path: Path) -> None:
    check = "checksum: { signal: Button5, kind: sum_id }"
    answers = problems(tmp_path, ("enable: Button1", f"enable: Button1\n    {check}"))
    assert answers == [
        "joysticks.left.checksum.kind: expected a known source with 'sum_id', which depends on the"
        " id, got BJM1 from any"
    ]


def test_the_file_may_name_the_source(tmp_path: Path) -> None:
    stop = STOP.replace("Button1", "Button1, source: 51")
    bound = load(tmp_path, ("axes:\n", stop)).emergency_stop
    assert bound is not None
    assert bound.key == ("crane", 0x0CFDDA33, True)
