"""A study with people: plan, key, placements, and a crane that does not name its setting."""

import math
from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from canshaper.bus.port import open_port
from canshaper.cli.app import app
from canshaper.codec.frame import Frame
from canshaper.config.schema import Bus
from canshaper.errors import UsageError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shipped import deployment_path
from canshaper.studio.in_process import InProcessCrane
from canshaper.studio.study import LIMIT_S, ORDERS, SHOWN_S, Session, Table, plan, rows_of
from canshaper.studio.study_stage import CRANE, RealJoysticks, StudyStage, setting
from canshaper.studio.view import CraneView
from canshaper_sim.hand import Hand, Held
from canshaper_sim.parameters import changed_parameters
from tests.studio.conftest import Listener, free_groups

COUNTS, BREAK_S = (2, 18), 10.0
COMMON = {"study": "0123abcd", "person": "P01", "order": "ABC"}
START = ["start_radius_m=5", "start_height_m=2.2"]


def test_orders_are_latin_squares_in_which_each_follows_each() -> None:
    for square in (ORDERS[:3], ORDERS[3:]):
        assert all(len({order[place] for order in square}) == 3 for place in range(3))
    follow = Counter(pair for order in ORDERS for pair in pairwise(order))
    assert set(follow.values()) == {2} and len(follow) == 6


def test_a_plan_has_each_target_as_often_in_reach_and_in_random_order() -> None:
    planned = plan(COUNTS, 5.0, "BCA", "1 P01")
    assert [one.setting for one in planned] == ["B"] * 20 + ["C"] * 20 + ["A"] * 20
    assert [one.practice for one in planned][:20] == [1, 1] + [0] * 18
    targets = Counter(
        (one.setting, one.distance_m, one.width_m) for one in planned if not one.practice
    )
    assert len(targets) == 27 and set(targets.values()) == {2}
    for one, place in planned.items():
        assert math.dist(place, (5.0, 0.0)) == pytest.approx(one.distance_m)
        assert 2.5 <= math.hypot(*place) <= 7.5 and place[0] > 0.7
    assert plan(COUNTS, 5.0, "BCA", "1 P01") == planned
    orders = [[one[4:] for one in plan(COUNTS, 5.0, "BCA", f"1 {who}")] for who in ("P01", "P02")]
    assert orders[0] != orders[1]
    assert orders[0][2:11] != orders[0][11:20]


class Person:
    """A person at work, without a crane."""

    def __init__(self, folder: Path) -> None:
        self.now_s, self.settings = 100.0, list[str]()
        self.planned = plan(COUNTS, 5.0, "ABC", "1 P01")
        self.table = Table(folder / "P01.csv", dict(COMMON))
        self.work = Session(self.planned, BREAK_S, self.table, self.settings.append)
        self.see("ready")

    def see(
        self, level: str, place: tuple[float, float] = (5.0, 0.0), after_s: float = 0.1
    ) -> None:
        self.now_s += after_s
        self.work.see(level, place, 3.0, self.now_s)

    def shown(self) -> dict[str, Any]:
        return self.work.shown(self.now_s)

    def begin(self) -> None:
        self.work.begin(self.now_s)

    def grip(self) -> None:
        self.work.grip("keyboard", self.now_s)

    def target(self) -> tuple[float, float]:
        x, y, _ = self.shown()["target"]
        return x, y

    def place(self, off_m: float = 0.0) -> None:
        """Do a placement, so far off, and wait until the next one."""
        x, y = self.target()
        for _ in range(5):
            self.see("ready")
        self.see("move")
        for _ in range(10):
            self.see("move", (x + off_m, y))
        self.grip()
        for _ in range(round(SHOWN_S / 0.1) + 1):
            self.see("ready", (x + off_m, y))


@pytest.fixture
def person(tmp_path: Path) -> Person:
    return Person(tmp_path)


def test_a_placement_counts_from_the_first_motion_to_the_grip(person: Person) -> None:
    person.begin()
    width = person.shown()["target"][2]
    person.grip()  # nothing moves yet
    assert person.shown()["phase"] == "ready" and not person.table.rows
    person.place(0.49 * width)
    width = person.shown()["target"][2]
    person.place(0.51 * width)
    hit, miss = rows_of(person.table.path, COMMON["study"])
    assert (hit["outcome"], miss["outcome"]) == ("hit", "miss")
    assert (hit["seconds"], hit["swing_deg"], hit["practice"]) == ("1.000", "3.000", "1")
    assert float(hit["reaction_s"]) == pytest.approx(0.6)
    assert float(miss["error_m"]) == pytest.approx(0.51 * width, abs=0.001)
    assert person.shown()["number"] == 3 and person.shown()["practice"] is False
    assert person.settings == ["A"] * 3  # a fresh crane for each


def test_all_settings_come_after_breaks_and_then_it_is_done(person: Person) -> None:
    for part in range(3):
        person.begin()
        for _ in range(20):
            person.place()
        if part < 2:
            assert person.shown()["phase"] == "pause" and person.shown()["wait_s"] >= 9
            person.begin()  # too soon
            assert person.shown()["phase"] == "pause"
            person.see("ready", after_s=11.0)
    assert person.shown()["phase"] == "done"
    assert [row["setting"] for row in person.table.rows] == ["A"] * 20 + ["B"] * 20 + ["C"] * 20


def test_what_is_broken_off_is_not_done_and_comes_again(person: Person, tmp_path: Path) -> None:
    person.begin()
    person.place()
    breaks: dict[str, Callable[[], None]] = {
        "stopped": lambda: person.see("wait"),
        "held": lambda: person.see("move", after_s=0.4),
        "page": lambda: person.work.break_off("page", person.now_s),
        "unplugged": lambda: person.work.break_off("unplugged", person.now_s),
        "long": lambda: [person.see("move") for _ in range(round(LIMIT_S / 0.1) + 2)] and None,
    }
    for why, happens in breaks.items():
        person.see("move")
        happens()
        assert (person.shown()["phase"], person.shown()["why"]) == ("pause", why)
        person.begin()
    broken = person.table.rows[1:]
    assert [(row["outcome"], row["why"]) for row in broken] == [("broken", w) for w in breaks]
    assert [row["number"] for row in broken] == ["2", "3", "4", "5", "6"]
    again = Person(tmp_path)  # the program was ended: what is done stays done
    assert [one.number for one in again.work._todo[:2]] == [2, 3]
    for _ in range(14):
        person.place()
    assert [person.work._todo[k].number for k in range(5)] == [2, 3, 4, 5, 6]


def test_a_page_that_is_gone_before_the_first_motion_breaks_nothing_off(person: Person) -> None:
    person.begin()
    person.work.break_off("page", person.now_s)
    assert person.shown()["phase"] == "ready" and not person.table.rows


def test_a_row_that_was_cut_off_is_taken_away(tmp_path: Path) -> None:
    person = Person(tmp_path)
    person.begin()
    person.place()
    with (path := person.table.path).open("ab") as file:
        file.write(b"0123abcd,P01,keyb")
    assert len(Table(path, dict(COMMON)).rows) == 1
    assert len(rows_of(path, COMMON["study"])) == 1
    with pytest.raises(UsageError, match="expected placements of the study 77777777"):
        Table(path, {**COMMON, "study": "77777777"})


def swing_deg(deployment: Deployment, *, anti_sway: bool) -> float:
    """Largest sway of a slew of a second."""
    crane, view = InProcessCrane(deployment), CraneView(deployment, lambda _text, _level: None)
    largest = 0.0
    for k in range(200):
        held = Held({"slew": 1.0 if 20 < k < 70 else 0.0}, enable=True, anti_sway=anti_sway)
        for frame in crane.frames(held, 20):
            view.receive(frame, k * 0.02)
        largest = max(largest, *map(abs, view.sway_deg or (0.0,)))
    return largest


@pytest.mark.parametrize("name", ["forwarder-robust.yaml", "forwarder-sensor.yaml"])
def test_a_raw_setting_is_the_crane_with_anti_sway_off(name: str, tmp_path: Path) -> None:
    path = deployment_path(name)
    own = load_deployment(path)
    raw, shaped = setting(path, tmp_path, raw=True), setting(path, tmp_path)
    off = swing_deg(own, anti_sway=False)
    assert off > 15.0
    assert swing_deg(raw, anti_sway=True) == pytest.approx(off, abs=0.2)
    assert swing_deg(shaped, anti_sway=False) == swing_deg(shaped, anti_sway=True) < 0.7 * off


def stage_of(folder: Path, joysticks: RealJoysticks | None = None) -> StudyStage:
    robust = deployment_path("forwarder-robust.yaml")
    settings = {"A": setting(robust, folder, raw=True), "B": setting(robust, folder)}
    settings["C"] = setting(deployment_path("forwarder-gff.yaml"), folder)
    table = Table(folder / "P01.csv", dict(COMMON))
    return StudyStage(
        settings, plan(COUNTS, 5.0, "ABC", "1 P01"), 1.0, table,
        parameters=changed_parameters(START), changes=START, joysticks=joysticks, done=lambda: None,
    )  # fmt: skip


@pytest.fixture
def stage(tmp_path: Path) -> StudyStage:
    return stage_of(tmp_path)


def test_nothing_that_a_page_gets_depends_on_the_setting(stage: StudyStage) -> None:
    """The page gets pose and swing alone, at rest and while it slews."""
    seen = []
    for letter in "ABC":
        stage._put(letter)
        session = stage.cranes[CRANE]
        assert session.here
        for k in range(40):
            held = Held({"slew": 1.0 if k > 20 else 0.0}, enable=True)
            for frame in session.here.frames(held, 20):
                session.view.receive(frame, k * 0.02)
        shown = stage.snapshot()
        crane = shown["cranes"][CRANE]
        del crane["pose"], crane["sway"]
        assert [axis["joystick"] for axis in crane["axes"].values()] == [1.0, 0.0, 0.0]
        seen.append({**shown, "t": 0.0})
    assert seen[0] == seen[1] == seen[2]
    assert stage.events.since(0) == []


def test_only_the_page_that_drives_begins_and_grips(stage: StudyStage) -> None:
    stage.with_cab(lambda cab, now_s: cab.take(1, now_s))
    assert stage.other(2, {"study": "begin"}) and stage.study.phase == "pause"
    assert stage.other(1, {"study": "begin"}) and stage.study.phase == "ready"
    for word in (7, "unseal", "grip", "broken"):
        assert not stage.other(1, {"study": word, "by": "P. Smith", "why": []})


def test_real_joysticks_drive_and_grip_and_nothing_is_sent(tmp_path: Path) -> None:
    """Frames of a real crane on their bus do not count."""
    bus = Bus(interface="udp_multicast", channel=free_groups()[0])
    deployment = load_deployment(deployment_path("forwarder-robust.yaml"))
    deployment.config.buses["crane"] = bus
    for wrong in ("JoystickRight", "JoystickRight.Nothing", "Nothing.Grip"):
        with pytest.raises(UsageError, match="--grip: expected MESSAGE"):
            RealJoysticks(deployment, wrong)
    joysticks = RealJoysticks(deployment, "JoystickRight.Reset")
    sender, listener = open_port("crane", bus, lambda _: None), Listener(bus.channel)
    try:
        stage, hand, sent = stage_of(tmp_path, joysticks), Hand(deployment), 0
        stage.with_cab(lambda cab, now_s: cab.take(1, now_s))
        found = deployment.messages.find("TipPosition")
        assert not isinstance(found, str)
        pose = Frame("crane", found[1].frame_id, found[1].is_extended_frame, bytes(8))
        while stage.study.phase == "pause":  # on a busy machine a tick comes too late: once more
            stage.other(1, {"study": "begin"})
            for k in range(60):
                held = Held({"slew": 1.0 if k > 30 else 0.0}, enable=True, reset=k > 50)
                for frame in (*hand.frames(0, held), pose):
                    sender.send(frame)
                    sent += 1
                stage._tick(0, 0, 0)
        row = stage.study._table.rows[-1]
        assert (row["input"], row["setting"], row["outcome"]) == ("CAN", "A", "miss")
        assert len(listener.frames()) == sent  # nobody but the hand, and that crane
        for frame in (*hand.frames(0, Held()), pose):
            sender.send(frame)
        sent = {frame.can_id for frame in joysticks.frames_of_tick(0, 20)}
        assert sent == {frame.can_id for frame in hand.frames(0, Held())}
    finally:
        for port in (joysticks, sender, listener.port):
            port.close()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("--person P.Smith", "--person: expected 1 to 12 letters and digits"),
        ("--person P01 --unseal", "--unseal: expected without --person"),
        ("--person P01 --grip A.B", "with --bus"),
        ("--person P01 --with forwarder-robust.yaml", "--with: expected another file"),
        ("--person P01 --set start_radius_m=1.9", "expected 2 .. 8 m, got 1.9"),
        ("--person P01 --with j1939-forwarder.yaml", "--with: expected axes and joysticks of"),
    ],
)
def test_what_cannot_be_is_one_line(options: str, said: str, tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["study", "--folder", str(tmp_path), *options.split()])
    assert result.exit_code == 2 and said in result.stderr
    assert result.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
