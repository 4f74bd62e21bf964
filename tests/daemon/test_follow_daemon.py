"""The daemon whose ticks follow a joystick, and its black box."""

import random
from itertools import pairwise
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.daemon.daemon import Daemon
from canshaper.daemon.follow import AFTER_NS
from canshaper.daemon.notify import ServiceManager
from canshaper.machine.binding import load_deployment
from tests.daemon.bench import Bench

MS = 1_000_000
PERIOD_NS = 20 * MS
MOST_NS = 200_000  # 1 % of it


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    made = Bench(tmp_path, monkeypatch)
    made.text = made.text.replace("buses:\n", "tick: { follow: left }\nbuses:\n", 1)
    made.file.write_text(made.text, encoding="utf-8")
    return made


def driven(
    bench: Bench, last: int, *, cut: int = 8, cycle_ns: int = PERIOD_NS, **reloads: tuple[int, str]
) -> list[int]:
    """Ticks of a daemon whose joystick comes 5 ms after the deadlines that it began with."""
    at_ns, ticks = bench.now_ns + 5 * MS, list[int]()

    def script(number: int) -> None:
        nonlocal at_ns
        ticks.append(bench.now_ns)
        while at_ns <= bench.now_ns + PERIOD_NS:
            frame = bench.rig.joystick("JoystickLeft")
            bench.ports[0].waiting.append((at_ns, frame._replace(data=frame.data[:cut])))
            at_ns += cycle_ns
        for at, old in reloads.values():
            if at == number:
                bench.reload(old)
        if number == last:
            bench.stop()

    bench.run(script)
    return ticks


@pytest.mark.parametrize(
    ("cut", "cycle_us", "phase_ns"),
    [(8, 20_000, 5 * MS + AFTER_NS), (7, 20_000, 0), (8, 20_400, None)],
)
def test_the_daemon_comes_after_frames_that_count_and_says_where_it_cannot(
    bench: Bench, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, *,
    cut: int, cycle_us: int, phase_ns: int | None,
) -> None:  # fmt: skip
    begin_ns, lines = bench.now_ns, list[str]()
    monkeypatch.setattr(ServiceManager, "status", lambda _, text: lines.append(text))
    caplog.set_level("WARNING", "canshaper")
    ticks = driven(bench, 150, cut=cut, cycle_ns=cycle_us * 1000)
    (phase,) = {(at - begin_ns) % PERIOD_NS for at in ticks[100:]}
    said = [record.message for record in caplog.records if "tick=" in record.message]
    if phase_ns is None:
        assert said == ["tick=plain joystick=left cycle_ms=20.40 expected=20"]
        assert lines[-1].startswith("tick plain, slew ")
    else:
        assert (phase, said) == (phase_ns, [])
        assert lines[-1].startswith("slew ")


def test_a_black_box_of_a_joystick_that_is_not_steady_and_of_late_ticks_is_played_the_same(
    bench: Bench, tmp_path: Path
) -> None:
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
    Daemon(lambda: load_deployment(bench.file), folder).run()
    (box,) = folder.iterdir()
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


def test_a_reload_ends_it_and_begins_it(bench: Bench) -> None:
    ticks = driven(bench, 70, ends=(10, "tick: { follow: left }\n"), begins=(40, ""))
    apart = [second - first for first, second in pairwise(ticks)]
    assert set(apart[2:9]) == {PERIOD_NS + MOST_NS}
    assert set(apart[15:40]) == {PERIOD_NS}
    assert set(apart[45:60]) & {PERIOD_NS + MOST_NS, PERIOD_NS - MOST_NS}
