"""The way of a frame: from a joystick's to the valves', behind the gate, in motion.

A way that grows needs its numbers changed here, and a reason: the last function tells gate and axis
how much faster than asked a motion may make an axis.
"""

import sys
from types import FrameType

import pytest

from tests.rigs.files import ROOT
from tests.rigs.forwarder import Rig

SLEW = 600
PACKAGE = f"{ROOT / 'canshaper'}/"


@pytest.mark.parametrize(
    ("file", "functions", "files"), [("forwarder", 32, 16), ("forwarder-robust", 49, 22)]
)
def test_the_way_of_a_frame_grows_no_longer(file: str, functions: int, files: int) -> None:
    rig = Rig(ROOT / "config" / f"{file}.yaml")
    rig.run(3)
    rig.run(30, Slew=SLEW)
    frame = rig.joystick(Slew=SLEW)
    called: set[tuple[str, str]] = set()

    def on_event(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code.co_filename.startswith(PACKAGE):
            called.add((frame.f_code.co_filename, frame.f_code.co_qualname))

    sys.setprofile(on_event)
    try:
        rig.receive(frame)
        sent = list(rig.controller.tick(rig.now_ns))
    finally:
        sys.setprofile(None)
    print(
        *(f"{place.removeprefix(PACKAGE)} {name}" for place, name in sorted(called)),
        sep="\n",
    )
    assert any(any(frame.data[:2]) for frame in sent)  # in motion
    assert len(called) <= functions
    assert len({place for place, _ in called}) <= files
