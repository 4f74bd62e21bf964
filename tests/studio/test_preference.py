"""The slider from quicker to calmer: its ends, what it says, and what the daemon then has."""

import asyncio
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest

from canshaper.config.filters import Filter, filter_of
from canshaper.design.tuning.verdict import USELESS
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shipped import deployment_path
from canshaper.studio import preference
from canshaper.studio.client import Client
from canshaper.studio.crane import copied
from canshaper.studio.in_process import InProcessCrane
from canshaper.studio.preference import AS_IN_FILE, PREFERENCE, Preference, offered
from canshaper.studio.stage import Stage
from canshaper_sim.hand import Held
from tests.studio.conftest import Studio
from tests.studio.page import WAIT_S

AXES = ["slew", "near_far"]


def copy(folder: Path, name: str = "forwarder.yaml") -> tuple[Path, Deployment]:
    folder.mkdir(exist_ok=True)
    return copied(deployment_path(name), folder)


def setting(chosen: Filter, tail_s: float = 2.0, **changes: Any) -> dict[str, Any]:
    return {"filter": chosen.model_dump(exclude_none=True), "tail_s": tail_s, **changes}


QUICK = setting(filter_of("gff", poles_rad_s=[-5.0, -5.0], third_pole_rad_s=-5.0))
CALM = setting(filter_of("gff", poles_rad_s=[-2.5, -2.5]), 1.9)


@pytest.fixture
def known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Preference]:
    """A slider whose settings are known, so that no process computes them."""
    path, _ = copy(tmp_path / "copy")
    one = Preference(path)
    found = {axis: {"file": {}, "choose": [QUICK, CALM]} for axis in AXES}
    monkeypatch.setattr(one, "found", lambda: found)
    return path, one


def test_only_filters_that_are_designs_have_settings() -> None:
    assert offered(load_deployment(deployment_path("forwarder.yaml")).config) == AXES
    assert offered(load_deployment(deployment_path("forwarder-robust.yaml")).config) == AXES
    assert offered(load_deployment(deployment_path("forwarder-load.yaml")).config) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["forwarder.yaml", "forwarder-robust.yaml"])
def test_settings_are_within_the_ends(name: str, tmp_path: Path) -> None:
    path, deployment = copy(tmp_path / "copy", name)
    one = Preference(path)
    found = one.found()
    assert one.found() is found  # computed once
    assert list(found) == AXES
    for axis, settings in found.items():
        sway = deployment.axes[axis].config.sway
        assert sway is not None
        own, choose = settings["file"], settings["choose"]
        assert own["tail_s"] == deployment.axes[axis].config.limits.tail_s
        assert len(choose) >= 5
        run_on = [one["run_on_m"] for one in choose]
        assert run_on == sorted(run_on)
        assert run_on[-1] > 1.5 * run_on[0]
        assert max(one["left"] for one in choose) <= USELESS
        if name == "forwarder-robust.yaml":
            left = [one["left"] for one in choose]
            assert left == sorted(left, reverse=True)  # those that stop_distance_m cuts are none
            assert left[-1] < 0.06
            shortest = choose[0]["filter"]["designed_for"]["duration_s"]
            assert shortest == pytest.approx(0.5 * sway.mode().period_s, abs=0.02)
    for position in (0.0, 0.3, 1.0):
        one.write(position)


def test_they_end_where_the_grapple_is_still_earlier_without(tmp_path: Path) -> None:
    """Half of the damping more, and no filter of 1.8 s is any quicker than none."""
    path, deployment = copy(tmp_path / "copy", "forwarder-robust.yaml")
    chosen = deployment.axes["near_far"].config.filter
    kept = preference._fitting(deployment, "near_far", chosen, 2.2)
    assert kept is not None
    assert kept["still_s"] == pytest.approx(1.8, abs=0.1)
    data = json.loads(path.read_text())
    data["axes"]["near_far"]["sway"]["damping_nms"] = 700
    path.write_text(json.dumps(data))
    assert preference._fitting(load_deployment(path), "near_far", chosen, 2.2) is None


@pytest.mark.parametrize(
    ("chosen", "tail_s"),
    [
        (filter_of("gff", poles_rad_s=[-40.0, -40.0]), 2.2),  # shorter than half a swing
        (filter_of("gff", poles_rad_s=[-0.5, -0.5]), 2.2),  # useless behind this tail
        (filter_of("gff", poles_rad_s=[-1.2, -1.2]), 5.0),  # farther than the file allows
    ],
    ids=["short", "useless", "far"],
)
def test_they_end_where_a_setting_is_none(chosen: Filter, tail_s: float) -> None:
    deployment = load_deployment(deployment_path("forwarder-robust.yaml"))
    assert preference._fitting(deployment, "near_far", chosen, tail_s) is None
    good = filter_of("gff", poles_rad_s=[-2.9, -2.9])
    assert preference._fitting(deployment, "near_far", good, 2.2) is not None


def test_a_position_is_written_and_taken_back(known: tuple[Path, Preference]) -> None:
    path, one = known
    before = load_deployment(path).config
    calm = one.write(1.0).config.axes["near_far"]
    assert calm.filter.parameters() == {"poles_rad_s": [-2.5, -2.5]}
    assert calm.limits.tail_s == 1.9
    quick = one.write(0.2).config.axes["slew"]
    assert quick.filter.parameters()["third_pole_rad_s"] == -5.0
    with pytest.raises(ValueError, match="slider preference: expected 0 to 1"):
        one.write(1.5)
    assert load_deployment(path).config.axes["slew"] == quick
    assert one.write(AS_IN_FILE).config == before


def commands(crane: InProcessCrane, held: Held, cycles: int) -> list[bytes]:
    frames = [f for _ in range(cycles) for f in crane.frames(held, crane.cycle_ms)]
    return [frame.data[:1] for frame in frames if frame.can_id == 0x200]


def test_a_crane_in_this_process_takes_it_at_rest(known: tuple[Path, Preference]) -> None:
    path, preferred = known
    rest, slewing = Held(enable=True), Held({"slew": 0.6}, enable=True)
    one, other = InProcessCrane(load_deployment(path)), InProcessCrane(load_deployment(path))
    for held, cycles in ((rest, 50), (slewing, 20)):
        assert commands(one, held, cycles) == commands(other, held, cycles)
    other.reload(preferred.write(0.0))
    for held, cycles in ((slewing, 40), (rest, 300)):  # it goes on as it was, until it rests
        assert commands(one, held, cycles) == commands(other, held, cycles)
    assert commands(one, slewing, 40) != commands(other, slewing, 40)


@pytest.mark.slow
def test_the_daemon_takes_it_and_the_next_driver_has_that_of_the_file(
    own: Callable[..., Studio],
) -> None:
    studio = own()

    def asked(what: str) -> Any:
        with urlopen(f"http://{studio.host}/{what}.json", timeout=4 * WAIT_S) as answer:
            return json.load(answer)

    with studio.page() as page:
        assert page.hello["preference"] is True
        page.drive()
        page.send(settings=True)
        assert list(page.until(lambda s: "settings" in s, "settings")["settings"]) == AXES
        assert all("settings" not in shown for shown in page.for_s(1.0))  # said once
        before = asked("residuals")
        page.send(slide=PREFERENCE, to=1.0)
        page.until(lambda s: s["sliders"][PREFERENCE] == 1.0, "slider")
        assert any("at the next standstill" in text for text in page.texts())
        assert asked("residuals") != before
        page.until(lambda s: s["cranes"]["shaped"]["daemon"] and page.states() == {"ready"})
        page.send(slide=PREFERENCE, to=2.0)
        page.until(lambda _: any("expected 0 to 1" in text for text in page.refused))
    with studio.page() as page:
        page.until(lambda s: s["sliders"][PREFERENCE] == AS_IN_FILE, "that of the file")
        assert asked("residuals") == before


class Driving:
    """A connection whose page takes the seat, asks for other filters, and goes once refused."""

    def __init__(self) -> None:
        texts = [{"do": "take"}, {"slide": PREFERENCE, "to": AS_IN_FILE}]
        self._messages = [{"type": "websocket.receive", "text": json.dumps(one)} for one in texts]
        self._answered = asyncio.Event()
        self.refused: list[str] = []

    async def receive(self) -> dict[str, Any]:
        if self._messages:
            return self._messages.pop(0)
        await self._answered.wait()
        return {"type": "websocket.disconnect"}

    async def send_text(self, text: str) -> None:
        if refused := json.loads(text).get("refused"):
            self.refused += refused
            self._answered.set()


def test_filters_that_cannot_be_written_are_refused_and_the_page_goes_on(tmp_path: Path) -> None:
    """The copy is gone, as after a clean-up of the folder for temporary files."""
    path, deployment = copy(tmp_path / "copy")
    stage = Stage(deployment)
    stage.drive_here()
    path.unlink()

    async def serve() -> list[str]:
        page: Any = Driving()
        await asyncio.wait_for(Client(page, stage, 1, {}).serve(), WAIT_S)
        return page.refused  # type: ignore[no-any-return]

    assert [text for text in asyncio.run(serve()) if "No such file" in text]
    stage.positions[PREFERENCE] = 0.5
    stage._reset_sliders()  # for the next driver
    assert [one.level for one in stage.events.since(0) if "No such file" in one.text] == ["warn"]
    assert stage.positions[PREFERENCE] == 0.5


def test_a_process_that_cannot_read_the_file_offers_nothing(tmp_path: Path) -> None:
    path, _ = copy(tmp_path / "copy")
    one = Preference(path)
    shutil.move(path, tmp_path / "away")
    assert one.found() == {}
    one.stop()
