"""A crane in the page's own process: its time, and its numbers."""

from pathlib import Path

import pytest

from canshaper.machine.deployment import Deployment
from canshaper.shaping.shapers.gff import Gff
from canshaper.shipped import deployment_path
from canshaper.studio.crane import copied
from canshaper.studio.in_process import MOST_MS, InProcessCrane
from canshaper.studio.numbers import sliders, values
from canshaper_sim.hand import Held

REST, SLEWING = Held(enable=True), Held({"slew": 0.6}, enable=True)


def deployment(folder: Path) -> Deployment:
    return copied(deployment_path("forwarder.yaml"), folder)[1]


def commands(crane: InProcessCrane, held: Held, cycles: int) -> list[bytes]:
    """Velocities of slew in so many cycles of the joysticks; the counter begins anywhere."""
    frames = [f for _ in range(cycles) for f in crane.frames(held, crane.cycle_ms)]
    return [frame.data[:1] for frame in frames if frame.can_id == 0x200]


def test_a_slider_changes_the_filter(tmp_path: Path) -> None:
    machine = deployment(tmp_path)
    one, other = InProcessCrane(machine), InProcessCrane(machine)
    assert commands(one, REST, 50) == commands(other, REST, 50)
    assert commands(one, SLEWING, 40) == commands(other, SLEWING, 40)
    commands(one, REST, 300)
    commands(other, REST, 300)
    possible = sliders(machine.config)
    other.change(values(possible, next(iter(possible)), 1.5))
    assert commands(one, SLEWING, 40) != commands(other, SLEWING, 40)


def test_a_computer_that_was_asleep_goes_on_where_it_was(tmp_path: Path) -> None:
    crane = InProcessCrane(deployment(tmp_path))
    commands(crane, REST, 50)
    frames = [f for f in crane.frames(SLEWING, 3_600_000) if f.can_id == 0x200]
    assert len(frames) == MOST_MS // 20


def test_the_error_of_a_filter_is_reported_with_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(self: Gff, command: float) -> float:
        raise ZeroDivisionError("line 7")

    reported: list[tuple[str, str]] = []
    crane = InProcessCrane(deployment(tmp_path), report=lambda *event: reported.append(event))
    monkeypatch.setattr(Gff, "step", fails)
    commands(crane, REST, 5)
    text, level = reported[0]
    line = fails.__code__.co_firstlineno + 1
    assert text.endswith(f"ZeroDivisionError: line 7 ({__file__}:{line})")
    assert (level, len(reported)) == ("bad", 2)  # one for each axis with this filter
