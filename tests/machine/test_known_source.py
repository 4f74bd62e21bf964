"""Messages of J1939 that need a known source address."""

from pathlib import Path

import pytest

from canshaper.machine.binding import load_deployment
from tests.rigs.files import ROOT, faults, machine_file

BJM3 = "bus: crane, message: BJM3, timeout_ms: 100"
SWITCH = f"switches:\n  seat: {{ {BJM3}, signal: Button1 }}\n\naxes:\n"
STOP = f"emergency_stop: {{ {BJM3}, signal: Button1 }}\n\naxes:\n"
RADIUS = (
    f"motion: {{ crane: {{ slew: slew, near_far: near_far,"
    f" radius: {{ {BJM3}, signal: XPosition }} }} }}\n\naxes:\n"
)


def changed(folder: Path, *changes: tuple[str, str]) -> Path:
    """The shipped machine of J1939 with texts replaced; a position of BJM3 is a length."""
    dbc = (ROOT / "dbc" / "j1939-bjm-avc.dbc").read_text(encoding="cp1252")
    start = dbc.index("BJM3: 8")
    position = 'XPosition : 6|10@1+ (0.1,0) [0|100] "%"'
    third = dbc[start:].replace(position, position.replace("%", "m"), 1)
    (folder / "machine.dbc").write_text(dbc[:start] + third, encoding="cp1252")
    own = (f"{ROOT}/dbc/j1939-bjm-avc.dbc", "machine.dbc")
    return machine_file(folder, "j1939-forwarder", own, *changes)


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
    assert faults(changed(tmp_path, ("axes:\n", section), enabled)) == [
        f"{place}.source: missing: in the DBC BJM3 may come from any source address; {what}"
        " needs a known one"
    ]


def test_the_file_may_name_the_source(tmp_path: Path) -> None:
    stop = STOP.replace("Button1", "Button1, source: 51")
    bound = load_deployment(changed(tmp_path, ("axes:\n", stop))).emergency_stop
    assert bound is not None
    assert bound.key == ("crane", 0x0CFDDA33, True)
