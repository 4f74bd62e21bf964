"""A drive that is over, as pictures for the page."""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import urlopen

import pytest
from typer.testing import CliRunner

from canshaper.campaign.run import Source, run_campaign
from canshaper.campaign.store import Store
from canshaper.cli.app import app
from canshaper.cli.common import loader
from canshaper.cli.finished_drives import opened_drives
from canshaper.design.parallel import Processes
from canshaper.studio import in_process
from canshaper.studio.playback import Playback
from tests.studio.conftest import Opened
from tests.studio.drives import black_box, recorded
from tests.studio.page import WAIT_S

SENT = frozenset((0x200, 0x201, 0x202))
ALL = (0.0, None)


def opened(
    file: object, *others: str, seeds: tuple[int, ...] = (), **more: Any
) -> tuple[Playback, dict[str, Any]]:
    """A drive as the page gets it: the object, and by crane the pictures with their times."""
    options = {"channels": (), "window": ALL, "changes": (), "folder": None, **more}
    folder = options.pop("folder")
    playback = opened_drives(str(file), others, seeds, folder, **options)[0].load()
    content = json.loads(json.dumps(playback.as_dict()))
    cranes = {
        name: [
            (number * in_process.PICTURE_S, picture)
            for number, picture in zip(crane["numbers"], crane["pictures"], strict=True)
        ]
        for name, crane in content["cranes"].items()
    }
    return playback, cranes


def texts(playback: Playback, crane: str) -> list[str]:
    return [text for _, name, text, _ in playback.as_dict()["events"] if name == crane]


@pytest.mark.slow
def test_a_log_shows_its_own_crane_and_what_each_deployment_would_have_done(tmp_path: Path) -> None:
    log = recorded(tmp_path / "drive.log")
    _, cranes = opened(log, "forwarder.yaml", "forwarder-robust.yaml")
    assert list(cranes) == ["recorded", "forwarder", "forwarder-robust"]
    own, same = cranes["recorded"], cranes["forwarder"]
    assert own[-1][0] > 15.0
    assert all(picture["measured"] for _, picture in own[5:])
    assert all(picture["simulated"] and not picture["measured"] for _, picture in same[5:])
    # The same deployment moves the simulated crane as the recorded one was moved.
    poses = [(a["pose"], b["pose"]) for (_, a), (_, b) in zip(own[25:], same[25:], strict=False)]
    assert max(abs(a[1] - b[1]) for a, b in poses) < 0.05
    assert max(abs(a[0] - b[0]) for a, b in poses) < 1.0
    assert max(a[0] for a, _ in poses) - min(a[0] for a, _ in poses) > 20.0
    valves = [[picture["axes"]["slew"]["valve"] for _, picture in one] for one in cranes.values()]
    assert max(map(abs, valves[1])) > 0.5
    assert valves[1] != valves[2]


@pytest.mark.slow
def test_a_log_of_joysticks_alone_has_no_recorded_crane(tmp_path: Path) -> None:
    log = tmp_path / "drive.log"
    rows = recorded(tmp_path / "all.log").read_text().splitlines(keepends=True)
    log.write_text("".join(row for row in rows if " 110#" in row or " 111#" in row))
    assert list(opened(log, "forwarder.yaml")[1]) == ["forwarder"]


@pytest.mark.slow
def test_a_black_box_is_played_as_it_was_next_to_another_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    box = black_box(tmp_path, monkeypatch)
    playback, cranes = opened(box, "forwarder-robust.yaml")
    assert list(cranes) == ["machine", "forwarder-robust"]
    assert any("frames compared, all the same" in note for note in playback.notes)
    for name in cranes:
        states = [picture["axes"]["slew"]["state"] for _, picture in cranes[name]]
        changes = [a for a, b in pairwise([*states, None]) if a != b]
        assert changes[:3] == ["waiting for neutral", "ready", "moving, shaped"] or changes[:2] == [
            "ready",
            "moving, shaped",
        ]
        assert "tripped: neutral" in changes
        assert any("slew: tripped: neutral" in text for text in texts(playback, name))


@pytest.mark.slow
def test_of_a_pause_there_are_no_pictures_and_no_silence_is_reported_in_it(tmp_path: Path) -> None:
    rows = recorded(tmp_path / "all.log").read_text().splitlines(keepends=True)
    rows = [row for row in rows if " 110#" in row or " 111#" in row]
    later = [row.replace("(17000000", "(17000010") for row in rows]
    log = tmp_path / "drive.log"
    log.write_text("".join([*rows, *later]))
    playback, cranes = opened(log, "forwarder.yaml")
    times = [time_s for time_s, _ in cranes["forwarder"]]
    assert times[-1] > 1000.0
    assert len(times) < 2000
    assert not [text for text in texts(playback, "forwarder") if "silent" in text]


@pytest.mark.slow
def test_of_a_long_log_the_first_pictures_or_those_of_a_window_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = recorded(tmp_path / "drive.log")
    _, cranes = opened(log, "forwarder.yaml", window=(2.0, 5.0))
    for pictures in cranes.values():
        assert pictures[0][0] == pytest.approx(2.0, abs=0.05)
        assert pictures[-1][0] == pytest.approx(5.0, abs=0.05)
    monkeypatch.setattr(in_process, "MOST_PICTURES", 100)
    playback, cranes = opened(log, "forwarder.yaml")
    assert {len(pictures) for pictures in cranes.values()} == {100}
    assert any("only the first ten minutes" in note for note in playback.notes)


@pytest.mark.slow
def test_a_drive_of_a_campaign_is_the_one_of_demo(tmp_path: Path) -> None:
    """The same seed, the same peak: to the resolution of the pictures."""
    playback, cranes = opened("forwarder.yaml", "forwarder-robust.yaml", seeds=(3,))
    assert list(cranes) == ["forwarder", "forwarder-robust", "raw"]
    assert playback.title.startswith("drive 3: ")
    arguments = ["demo", "forwarder.yaml", "--seed", "3", "--out", str(tmp_path)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    report = json.loads((tmp_path / "report.json").read_text())
    for name, key in (("raw", "raw"), ("forwarder", "shaped")):
        peak = max(abs(picture["sway"][0]) for _, picture in cranes[name] if picture["sway"])
        assert peak == pytest.approx(report["axes"]["slew"][key]["peak_deg"], rel=0.05)


@pytest.mark.slow
def test_the_worst_drives_of_a_campaign_can_be_chosen(tmp_path: Path) -> None:
    deployment = loader("forwarder.yaml")()
    source = Source.of(deployment, deployment.config.uncertainty)
    store = Store(tmp_path / "drives", source.about)
    run_campaign(Processes(1), source, range(12), store, lambda _done: None)
    choices = opened_drives(
        "forwarder.yaml", (), (), tmp_path / "drives", channels=(), window=ALL, changes=()
    )
    left = [float(choice.title.split(", ")[1].split("°")[0]) for choice in choices]
    assert len(left) == 10 or len(left) == len([f for f in store.columns()["fault"] if not f])
    assert left == sorted(left, reverse=True)
    assert choices[0].load().title in choices[0].title


@pytest.mark.slow
def test_what_cannot_be_opened_is_reported(tmp_path: Path) -> None:
    log = recorded(tmp_path / "drive.log", without=frozenset((0x110, 0x111)))
    (tmp_path / "none").mkdir()

    def refusal(*arguments: object) -> str:
        result = CliRunner().invoke(app, ["studio", "--port", "0", *map(str, arguments)])
        assert result.exit_code == 2, result.output
        return " ".join(result.output.split())

    assert "--with is missing: which deployment? A log has none" in refusal(log)
    assert "got none of its joystick messages" in refusal(log, "--with", "forwarder.yaml")
    assert "expected a deployment file, got the log" in refusal(log, "--seed", "3")
    assert "expected with a log, a black box" in refusal("forwarder.yaml", "--with", "x.yaml")
    many = [word for _ in range(3) for word in ("--with", "forwarder.yaml")]
    assert "--with: expected 2 at most, got 3" in refusal(log, *many)
    assert "none: expected the drives of a campaign" in refusal("--campaign", tmp_path / "none")
    assert "expected the folder of a campaign" in refusal("--campaign", tmp_path / "there")
    missing = refusal(tmp_path / "there.log", "--with", "forwarder.yaml")
    assert "there.log" in missing
    assert "No such file" in missing


@pytest.mark.slow
def test_each_drive_is_made_when_it_is_requested() -> None:
    studio = Opened("forwarder.yaml", "--seed", "3", "--seed", "4")

    def got(path: str) -> Any:
        with urlopen(f"http://{studio.host}{path}", timeout=WAIT_S) as answer:
            return json.load(answer)

    try:
        assert got("/drives.json") == ["drive 3", "drive 4"]
        for number, seed in ((0, 3), (1, 4), (0, 3)):
            drive = got(f"/drive/{number}.json")
            assert drive["title"].startswith(f"drive {seed}: ")
            assert drive["hello"]["cranes"] == ["forwarder", "raw"] == list(drive["cranes"])
        with pytest.raises(HTTPError, match="404") as absent:
            got("/drive/2.json")
        absent.value.close()
    finally:
        studio.stop()
