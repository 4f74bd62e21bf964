"""Drives that are over, for tests: the log of a simulated crane, the black box of a daemon."""

from pathlib import Path

import pytest

from canshaper.blackbox import keeper
from canshaper.cli.common import loader
from canshaper.codec.frame import Frame
from canshaper.design.lockstep import Simulation
from canshaper_sim.operator import script_named
from tests.blackbox.driven import SECOND, TRIP, drive
from tests.daemon.bench import Bench

START_S = 1_700_000_000.0


def recorded(path: Path, *, without: frozenset[int] = frozenset()) -> Path:
    """The log of the demo on the simulated crane: all frames but those of some ids."""
    deployment = loader("forwarder.yaml")()
    rows: list[str] = []

    def on_frame(frame: Frame, time_s: float) -> None:
        if frame.can_id not in without:
            row = f"({START_S + time_s:.6f}) crane {frame.can_id:03X}#{frame.data.hex().upper()}\n"
            rows.append(row)

    script = script_named("demo", list(deployment.axes))
    for _ in Simulation(deployment, script, on_frame).ticks():
        pass
    path.write_text("".join(rows), encoding="ascii")
    return path


def black_box(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The black box of a trip: enable is let go of after three seconds of slewing."""
    monkeypatch.setattr(keeper, "STATE_NS", 10**9)
    boxes = folder / "boxes"
    boxes.mkdir()
    drive(Bench(folder, monkeypatch), boxes, TRIP + 8 * SECOND)
    (path,) = boxes.iterdir()
    return path
