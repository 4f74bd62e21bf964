"""Sequences of faults in the whole daemon: what it has recorded is played the same, bit for bit."""

import os
from collections import Counter
from pathlib import Path
from unittest.mock import patch

import pytest

from canshaper.blackbox import keeper
from canshaper.daemon import daemon
from canshaper.recording import play
from tests.blackbox.kept import Kept, unpacked
from tests.faults.guarded import Unrefused
from tests.faults.sequence import Sequence
from tests.faults.shipped import NAMES

COUNT = int(os.environ.get("CANSHAPER_BOXES", "6"))


def kept(name: str, seed: int) -> list[tuple[bytes, bytes]]:
    """What the daemon has recorded in a sequence."""
    made: list[Kept] = []

    def make(folder: Path | None) -> Kept:
        made.append(Kept(folder))
        return made[-1]

    with (
        patch.object(daemon, "BlackBox", make),
        patch.object(keeper, "STATE_NS", 700_000_000),
    ):
        Sequence(name, seed).run()
    return [box for one in made for box in one.boxes]


@pytest.mark.parametrize("name", NAMES)
def test_what_is_played_is_the_same(name: str, tmp_path: Path) -> None:
    seen: Counter[str] = Counter()
    for seed in range(COUNT):
        for found in kept(name, seed):
            deployment, box = unpacked(found, tmp_path)
            box.segments = [  # at every third the state is the one that was kept
                one._replace(follows=one.follows and i % 3 > 0)
                for i, one in enumerate(box.segments)
            ]
            with patch.object(play, "Controller", Unrefused):
                player = play.Player(box, deployment)
                for tick, result in player.run(lambda part: None):
                    assert not result.differences, (seed, tick.number, result.differences)
                    seen["ticks"] += 1
                    seen["frames"] += result.compared
                    seen.update(event.split("=")[0] for event in result.events)
            seen["segments"] += len(box.segments)
            seen["boxes"] += 1
    assert seen["ticks"] > 50 * COUNT
    assert seen["frames"] > seen["ticks"]
