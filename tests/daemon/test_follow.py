"""Ticks that follow a joystick: how soon they are there, how steady, and what moves them."""

import random
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.config.load import load_config
from canshaper.controller.controller import Controller
from canshaper.daemon.daemon import Daemon
from canshaper.daemon.follow import AFTER_NS, CLUSTER_NS, TickFollower, tick_follower
from canshaper.daemon.notify import ServiceManager
from canshaper.errors import ConfigError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.daemon.bench import Bench
from tests.rigs.forwarder import ROOT

MS = 1_000_000
PERIOD_NS = 20 * MS
MOST_NS = 200_000  # 1 % of it


def deployment_of(folder: Path, follow: str = "left", **changed: str) -> Deployment:
    text = (ROOT / "config" / "forwarder.yaml").read_text(encoding="utf-8")
    text = text.replace("../dbc", str(ROOT / "dbc"))
    text = text.replace("buses:\n", f"tick: {{ follow: {follow} }}\nbuses:\n", 1)
    for old, new in changed.items():
        text = text.replace(old, new)
    file = folder / "machine.yaml"
    file.write_text(text, encoding="utf-8")
    return load_deployment(file)


class Joysticks:
    """Times of the last good frames of both joysticks in the controller."""

    def __init__(self, folder: Path) -> None:
        self.left, self.right = (SimpleNamespace(received_ns=None) for _ in range(2))
        controller: Any = SimpleNamespace(joysticks={"left": self.left, "right": self.right})
        self.follower = TickFollower(deployment_of(folder), controller)

    def waits(
        self,
        ticks: int,
        *,
        jitter_ns: int = 0,
        right_ns: int | None = None,
        begin_ns: int = 10**12 + 7 * MS,
        joystick_ns: int = PERIOD_NS,
        lost: float = 0.0,
    ) -> tuple[list[int], list[int]]:
        """From the left frame to the tick that reads it, and from tick to tick."""
        noise = random.Random(3)
        deadline = before = 10**12
        came = begin_ns
        waits, apart = [], []
        for _ in range(ticks):
            while (at := came + noise.randint(0, jitter_ns)) <= deadline:
                if noise.random() >= lost:
                    waits.append(deadline - at)
                    self.left.received_ns = at
                if right_ns is not None:
                    self.right.received_ns = at + right_ns
                came += joystick_ns
            if right_ns is not None and (self.right.received_ns or 0) > deadline:
                self.right.received_ns -= joystick_ns
            apart.append(deadline - before)
            before = deadline
            deadline += PERIOD_NS
            deadline += self.follower(deadline)
        return waits, apart[1:]


@pytest.fixture
def joysticks(tmp_path: Path) -> Joysticks:
    return Joysticks(tmp_path)


@pytest.mark.parametrize("phase_ms", range(0, 20, 3))
def test_within_a_second_a_frame_waits_no_longer_than_it_has_to(
    joysticks: Joysticks, phase_ms: int
) -> None:
    waits, apart = joysticks.waits(200, begin_ns=10**12 + phase_ms * MS)
    assert set(waits[60:]) == {AFTER_NS}
    assert max(abs(ns - PERIOD_NS) for ns in apart) <= MOST_NS


@pytest.mark.parametrize("drift_ns", [-20_000, 20_000])
def test_a_joystick_with_another_clock_is_followed(joysticks: Joysticks, drift_ns: int) -> None:
    waits, _ = joysticks.waits(2000, joystick_ns=PERIOD_NS + drift_ns)
    assert all(abs(ns - AFTER_NS) <= 2 * abs(drift_ns) for ns in waits[100:])


@pytest.mark.parametrize("part", [0.98, 1.02, 1.5])
def test_a_joystick_with_another_cycle_is_not_followed(joysticks: Joysticks, part: float) -> None:
    _, apart = joysticks.waits(300, joystick_ns=round(part * PERIOD_NS))
    assert set(apart[120:]) == {PERIOD_NS}
    assert not joysticks.follower.follows
    assert joysticks.follower.news().startswith("tick=plain joystick=left cycle_ms=")
    assert not joysticks.follower.news(), "once"
    waits, _ = joysticks.waits(300)
    assert joysticks.follower.news() == "tick=follows joystick=left cycle_ms=20.00 expected=20"
    assert set(waits[200:]) == {AFTER_NS}


@pytest.mark.parametrize("part", [0.995, 1.005])
def test_lost_frames_do_not_look_like_another_cycle(joysticks: Joysticks, part: float) -> None:
    waits, _ = joysticks.waits(600, joystick_ns=round(part * PERIOD_NS), lost=0.3)
    assert joysticks.follower.follows and not joysticks.follower.news()
    assert all(abs(ns - AFTER_NS) < 2 * MS for ns in waits[200:])


def test_a_joystick_that_is_not_steady_is_read_in_its_tick(joysticks: Joysticks) -> None:
    waits, apart = joysticks.waits(2000, jitter_ns=600_000)
    assert max(waits[100:]) < 2 * MS
    assert max(abs(ns - PERIOD_NS) for ns in apart) <= MOST_NS


@pytest.mark.parametrize(
    ("right_ns", "waits_ns"),
    [
        (0, AFTER_NS),
        (500_000, AFTER_NS + 500_000),
        (CLUSTER_NS, AFTER_NS + CLUSTER_NS),
        (CLUSTER_NS + 1, AFTER_NS),
        (-500_000, AFTER_NS),
        (10 * MS, AFTER_NS),
    ],
)
def test_of_several_joysticks_the_last_of_the_first_cluster_counts(
    joysticks: Joysticks, right_ns: int, waits_ns: int
) -> None:
    waits, _ = joysticks.waits(200, right_ns=right_ns)
    assert set(waits[100:]) == {waits_ns}


def test_without_a_frame_the_deadlines_stay_where_they_are(joysticks: Joysticks) -> None:
    assert joysticks.follower(10**12) == 0
    joysticks.left.received_ns = 10**12
    assert joysticks.follower(10**12 + PERIOD_NS) == MOST_NS
    assert joysticks.follower(10**12 + 2 * PERIOD_NS) == 0, "the same frame counts once"
    joysticks.left.received_ns = None
    assert joysticks.follower(10**12 + 3 * PERIOD_NS) == 0


# -- the daemon ------------------------------------------------------------------------------------


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    made = Bench(tmp_path, monkeypatch)
    made.text = made.text.replace("buses:\n", "tick: { follow: left }\nbuses:\n", 1)
    made.file.write_text(made.text, encoding="utf-8")
    return made


@pytest.mark.parametrize("whole", [True, False])
def test_the_daemon_comes_after_frames_that_count_only(bench: Bench, whole: bool) -> None:
    """5 ms after the deadlines that it began with, with a checksum or without."""
    begin_ns = bench.now_ns
    ticks: list[int] = []

    def script(number: int) -> None:
        ticks.append(bench.now_ns)
        frame = bench.rig.joystick("JoystickLeft")
        data = frame.data if whole else frame.data[:-1]
        at_ns = begin_ns + number * PERIOD_NS + 5 * MS
        bench.ports[0].waiting.append((at_ns, frame._replace(data=data)))
        if number == 80:
            bench.stop()

    bench.run(script)
    phases = {(at - begin_ns) % PERIOD_NS for at in ticks[60:]}
    assert phases == ({5 * MS + AFTER_NS} if whole else {0})


@pytest.fixture
def late_drive(bench: Bench, tmp_path: Path) -> tuple[Path, list[int]]:
    """A drive after a joystick that is not steady, late at times: its black box, and its ticks."""
    noise, ticks = random.Random(5), list[int]()
    at_ns = bench.now_ns + 5 * MS

    def script(number: int) -> None:
        nonlocal at_ns
        if 70 <= number < 90:
            bench.now_ns += noise.randint(41 * MS, 59 * MS)
        if number == 260:
            bench.now_ns += 300 * MS
        ticks.append(bench.now_ns)
        while at_ns <= bench.now_ns + PERIOD_NS:
            centred = number < 10 or 100 <= number < 220
            slew = 0 if centred else 500 + number % 300
            left = bench.rig.joystick("JoystickLeft", Slew=slew)
            came_ns = at_ns + noise.randint(-300_000, 300_000)
            bench.ports[0].waiting += [
                (came_ns, left),
                (came_ns + 400_000, bench.rig.joystick("JoystickRight")),
            ]
            at_ns += PERIOD_NS
        if number == 300:
            bench.stop()

    bench.script = script
    folder = tmp_path / "boxes"
    folder.mkdir()
    Daemon(lambda: load_deployment(bench.file), folder).run()
    (box,) = folder.iterdir()
    return box, ticks


def test_a_black_box_of_such_ticks_is_played_the_same(
    late_drive: tuple[Path, list[int]], bench: Bench, tmp_path: Path
) -> None:
    box, ticks = late_drive
    apart = {second - first for first, second in pairwise(ticks)}
    assert {PERIOD_NS + MOST_NS, PERIOD_NS - MOST_NS} & apart
    assert len(apart) > 50, "the deadlines are drawn to frames that are not steady"
    arguments = ["replay", str(box), "--verify", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    assert "every one the same to the last bit" in done.output
    assert "reason=LOOP_OVERRUN" in done.output
    assert "reason=LOOP_STALLED" in done.output
    status = load_deployment(bench.file).status
    assert status is not None
    sent = [frame.data for frame in bench.sent if frame[:3] == status.message.key]
    counted = status.decode(sent[-1]) or {}
    assert counted["MissedDeadlines"] == round((ticks[-1] - ticks[0]) / PERIOD_NS) - len(ticks) + 1


@pytest.mark.parametrize("cycle_us", [20_000, 20_400])
def test_the_daemon_says_that_it_does_not_follow(
    bench: Bench, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, cycle_us: int
) -> None:
    lines: list[str] = []
    monkeypatch.setattr(ServiceManager, "status", lambda _, text: lines.append(text))
    caplog.set_level("WARNING", "canshaper")
    at_ns, ticks = bench.now_ns + 5 * MS, list[int]()

    def script(number: int) -> None:
        nonlocal at_ns
        ticks.append(bench.now_ns)
        while at_ns <= bench.now_ns + PERIOD_NS:
            bench.ports[0].waiting.append((at_ns, bench.rig.joystick("JoystickLeft")))
            at_ns += cycle_us * 1000
        if number == 150:
            bench.stop()

    bench.run(script)
    apart = {second - first for first, second in pairwise(ticks[100:])}
    said = [record.message for record in caplog.records if "tick=" in record.message]
    assert apart == {PERIOD_NS}
    off = ["tick=plain joystick=left cycle_ms=20.40 expected=20"]
    assert said == ([] if cycle_us == 20_000 else off)
    assert lines[-1].startswith("slew " if cycle_us == 20_000 else "tick plain, slew ")


def test_where_the_command_line_takes_another_interface_the_ticks_stay(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("WARNING", "canshaper")
    deployment = deployment_of(tmp_path)
    assert tick_follower(deployment, Controller(deployment)) is not None
    buses = {
        n: b.model_copy(update={"interface": "virtual"}) for n, b in deployment.config.buses.items()
    }
    config = deployment.config.model_copy(update={"buses": buses})
    changed = replace(deployment, config=config)
    assert tick_follower(changed, Controller(changed)) is None
    (record,) = caplog.records
    assert record.message.startswith("tick=plain expected a bus of socketcan")


def test_a_reload_ends_it_and_begins_it(bench: Bench) -> None:
    begin_ns = bench.now_ns
    ticks: list[int] = []

    def script(number: int) -> None:
        ticks.append(bench.now_ns)
        bench.ports[0].waiting.append(
            (begin_ns + number * PERIOD_NS + 5 * MS, bench.rig.joystick("JoystickLeft"))
        )
        if number == 10:
            bench.reload("tick: { follow: left }\n", "")
        if number == 40:
            bench.reload()
        if number == 70:
            bench.stop()

    bench.run(script)
    apart = [second - first for first, second in pairwise(ticks)]
    assert set(apart[2:9]) == {PERIOD_NS + MOST_NS}
    assert set(apart[15:40]) == {PERIOD_NS}
    assert set(apart[45:60]) & {PERIOD_NS + MOST_NS, PERIOD_NS - MOST_NS}


def test_a_tick_names_a_joystick_that_can_be_followed(tmp_path: Path) -> None:
    def fault(**changed: str) -> str:
        with pytest.raises(ConfigError) as error:
            deployment_of(tmp_path, **changed)
        return str(error.value)

    assert "tick.follow: expected a joystick, got 'middle'; there are left, right" in fault(
        follow="middle"
    )
    assert (
        "tick.follow: expected a bus of socketcan, which stamps frames, got virtual, the bus of"
        " left" in fault(socketcan="virtual")
    )
    assert (
        "tick.follow: expected a GenMsgCycleTime that is a multiple or a part of 19 ms, got 20 ms,"
        " that of left" in fault(**{"tick_ms: 20": "tick_ms: 19"})
    )


@pytest.mark.parametrize("tick_ms", [10, 20])
def test_a_cycle_may_be_several_ticks(tmp_path: Path, tick_ms: int) -> None:
    deployment_of(tmp_path, **{"tick_ms: 20": f"tick_ms: {tick_ms}"})


def test_it_is_off_by_default_and_in_the_file_that_is_recommended() -> None:
    assert load_config(ROOT / "config" / "forwarder.yaml")[0].tick is None
    tick = load_config(ROOT / "config" / "forwarder-robust.yaml")[0].tick
    assert tick is not None
    assert tick.follow == "left"


# -- one deadline ----------------------------------------------------------------------------------


def step(cycle_ms: int, *others_ns: int, deadline_ns: int) -> int:
    """How much later the deadline shall be, with a frame of the followed joystick at 40 ms."""
    names = ["left", *(f"other {n}" for n, _ in enumerate(others_ns))]
    joystick = SimpleNamespace(message=SimpleNamespace(cycle_time=cycle_ms))
    config = SimpleNamespace(tick=SimpleNamespace(follow="left"), tick_ms=20)
    deployment: Any = SimpleNamespace(config=config, joysticks=dict.fromkeys(names, joystick))
    times = dict(zip(names, (40 * MS, *others_ns), strict=True))
    inputs = {name: SimpleNamespace(received_ns=ns) for name, ns in times.items()}
    controller: Any = SimpleNamespace(joysticks=inputs)
    return TickFollower(deployment, controller)(deadline_ns)


@pytest.mark.parametrize("ticks", [0, 1, 2, 3])
def test_a_joystick_every_second_tick_is_followed_by_both(ticks: int) -> None:
    at = 40 * MS + AFTER_NS + ticks * PERIOD_NS
    assert step(40, deadline_ns=at + 50_000) == -50_000
    assert step(40, deadline_ns=at - 50_000) == 50_000


def test_the_nearest_of_two_frames_in_a_tick_is_followed() -> None:
    assert step(10, deadline_ns=50 * MS + AFTER_NS + 50_000) == -50_000


def test_frames_that_stand_together_are_waited_for() -> None:
    """Half a millisecond before the next frame, and as far again: each is near the one before."""
    half, far = CLUSTER_NS // 2, CLUSTER_NS * 6 // 5
    for others, last in (
        ([40 * MS + half - PERIOD_NS], half),
        ([40 * MS + half, 40 * MS + far], far),
        ([40 * MS + far], 0),
    ):
        at = 40 * MS + last + AFTER_NS
        assert step(20, *others, deadline_ns=at + 50_000) == -50_000
