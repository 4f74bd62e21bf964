"""The radius of the tip, measured: which frames are a radius, for how long, and of what."""

from typing import Any

import pytest

from canshaper.codec.frame import FrameFault
from tests.rigs.forwarder import Make
from tests.rigs.radius import RadiusInput

STATUS = "status: { bus: crane, message: ShaperStatus }\n"
TIP = "radius: { bus: crane, message: TipPosition, signal: Radius, timeout_ms: 100 }"
MOTION = f"motion: {{ crane: {{ slew: slew, near_far: near_far, {TIP} }} }}\n"
# A radius with an offset, and with codes that lie within its range.
DBC = {
    "SG_ Radius : 16|16@1+ (0.001,0) [0|60]": "SG_ Radius : 16|16@1+ (0.002,1) [1|60]",
    "VAL_ 272 Enable": 'VAL_ 1025 Radius 5000 "Error" 5001 "NotAvailable" ;\nVAL_ 272 Enable',
}
NOW_NS = 7_000_000_000
TIMEOUT_NS = 100_000_000


def bound(make: Make) -> tuple[RadiusInput, Any]:
    rig = make({STATUS: MOTION + STATUS}, DBC)
    radius = rig.deployment.motions["crane"].radius
    assert radius is not None
    return RadiusInput(radius), rig.message("TipPosition")


def frame(message: Any, raw: int) -> bytes:
    values = {"SlewAngle": 0, "Radius": raw, "Height": 0}
    return bytes(message.encode(values, scaling=False, strict=False))


@pytest.mark.parametrize(("raw", "radius_m"), [(0, 1.0), (1500, 4.0), (29500, 60.0)])
def test_a_radius_has_scale_and_offset_and_the_ends_of_its_range(
    changed_rig: Make, raw: int, radius_m: float
) -> None:
    radius, message = bound(changed_rig)
    assert radius.receive(frame(message, raw), NOW_NS) is FrameFault.NONE
    assert radius.fresh(NOW_NS) == pytest.approx(radius_m)


@pytest.mark.parametrize("raw", [5000, 5001, 29501, 65535])
def test_a_code_or_a_value_out_of_range_is_no_radius_and_not_new(
    changed_rig: Make, raw: int
) -> None:
    radius, message = bound(changed_rig)
    assert radius.receive(frame(message, raw), NOW_NS) is FrameFault.INVALID_SIGNAL
    assert radius.fresh(NOW_NS) is None
    radius.receive(frame(message, 1500), NOW_NS)
    assert radius.receive(frame(message, raw), NOW_NS + TIMEOUT_NS) is FrameFault.INVALID_SIGNAL
    assert radius.fresh(NOW_NS + TIMEOUT_NS) == pytest.approx(4.0)
    assert radius.fresh(NOW_NS + TIMEOUT_NS + 1) is None


@pytest.mark.parametrize("length", [0, 5, 7, 8])
def test_a_frame_of_another_length_is_no_radius(changed_rig: Make, length: int) -> None:
    radius, message = bound(changed_rig)
    data = (frame(message, 1500) + bytes(2))[:length]
    assert radius.receive(data, NOW_NS) is FrameFault.WRONG_LENGTH
    assert radius.fresh(NOW_NS) is None
    radius.receive(frame(message, 1500), NOW_NS)
    assert radius.receive(data, NOW_NS + 1) is FrameFault.WRONG_LENGTH
    assert radius.fresh(NOW_NS + TIMEOUT_NS + 1) is None


def test_it_is_known_until_its_timeout_and_not_a_nanosecond_longer(changed_rig: Make) -> None:
    radius, message = bound(changed_rig)
    assert radius.fresh(NOW_NS) is None
    radius.receive(frame(message, 1500), NOW_NS)
    assert radius.fresh(NOW_NS + TIMEOUT_NS) == pytest.approx(4.0)
    assert radius.fresh(NOW_NS + TIMEOUT_NS + 1) is None
    radius.receive(frame(message, 2000), NOW_NS + TIMEOUT_NS + 1)
    assert radius.fresh(NOW_NS + 2 * TIMEOUT_NS) == pytest.approx(5.0)
    radius.invalidate()
    assert radius.fresh(NOW_NS + 2 * TIMEOUT_NS) is None
