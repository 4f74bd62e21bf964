"""Frames that are passed on with a checksum or an E2E header: it is made again."""

from pathlib import Path

from crccheck.crc import Crc8SaeJ1850

from canshaper.codec.e2e import Profile2
from canshaper.codec.frame import Frame
from tests.rigs.gateway import GatewayRig

CHECKSUM = (
    'SG_ AliveCounter : 56|8@1+ (1,0) [0|255] "" SHAPER\n\nBO_ 273',
    'SG_ AliveCounter : 56|8@1+ (1,0) [0|255] "" SHAPER\n'
    ' SG_ Checksum : 48|8@1+ (1,0) [0|255] "" SHAPER\n\nBO_ 273',
)
PROTECTED = (
    ("left:\n    bus: joysticks",
     "left:\n    checksum: { signal: Checksum, kind: crc8_sae_j1850 }\n    bus: joysticks"),
    ("JoystickLeft, signal: Slew, timeout_ms: 200,", "JoystickLeft, signal: Slew, timeout_ms: 200, "
     "checksum: { signal: Checksum, kind: crc8_sae_j1850 },"),
    ("JoystickLeft, signal: NearFar, timeout_ms: 200,",
     "JoystickLeft, signal: NearFar, timeout_ms: 200, "
     "checksum: { signal: Checksum, kind: crc8_sae_j1850 },"),
    ("fallback: neutral", "fallback: stop"),
)  # fmt: skip


def crc(data: bytes) -> int:
    checksum: int = Crc8SaeJ1850.calc(data[:6] + data[7:])
    return checksum


def test_the_checksum_is_made_again(tmp_path: Path) -> None:
    rig = GatewayRig(tmp_path, yaml=PROTECTED, dbc=(CHECKSUM,))
    bad = rig.joystick()
    assert rig.receive(bad) is None
    for joystick in (0, 0, 1000, 1000, 1000):
        frame = rig.joystick(Slew=joystick)
        right = frame.data[:6] + bytes((crc(frame.data),)) + frame.data[7:]
        passed = rig.receive(frame._replace(data=right))
        assert passed is not None
        assert passed.data[6] == crc(passed.data)
        assert passed.data != right or joystick == 0
        rig.tick()


def test_e2e_is_made_again(tmp_path: Path) -> None:
    """Its header fills the first 12 bits, so the joysticks move up by two bytes."""
    ids = list(range(1, 17))
    profile = Profile2(ids)
    e2e = f"e2e: {{ profile: p02, data_ids: {ids} }}"
    rig = GatewayRig(
        tmp_path,
        yaml=(
            ("fallback: neutral", "fallback: stop"),
            ("    alive_counter: AliveCounter\n  right", f"    {e2e}\n  right"),
            ("signal: Slew, timeout_ms: 200, alive_counter: AliveCounter",
             f"signal: Slew, timeout_ms: 200, {e2e}"),
            ("signal: NearFar, timeout_ms: 200, alive_counter: AliveCounter",
             f"signal: NearFar, timeout_ms: 200, {e2e}"),
        ),
        dbc=(
            (" Slew : 0|16@1-", " Slew : 16|16@1-"),
            ("NearFar : 16|16@1-", "NearFar : 40|16@1-"),
        ),
    )  # fmt: skip
    for count in range(1, 40):
        data = profile.protect(rig.joystick(Slew=1000 if count > 3 else 0).data, count % 16)
        passed = rig.receive(Frame("joysticks", 0x110, False, data))
        assert passed is not None
        assert profile.verify(passed.data)
        assert passed.data[1] & 0x0F == count % 16
        rig.tick()
    assert rig.decoded(rig.left[-1])["Slew"] > 200
