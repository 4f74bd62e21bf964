"""A daemon's own log, replayed, gives every frame to the last bit, however hard it is to read."""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from canshaper.cli.common import loader
from canshaper.machine.deployment import Deployment
from canshaper.recording.bundle import unpack
from canshaper.recording.frames import LogError
from canshaper.recording.replay import Replay, look
from tests.recording.daemon import Hardness, log_of

DATA = Path(__file__).parent / "data"
ROOT = Path(__file__).parents[2]
Load = Callable[[], Deployment]
VALVE, STATUS = "200", "300"


def replayed(load: Load, path: Path, *, by_daemon: bool = True) -> Replay:
    replay = Replay(load, look(load(), path, {}), by_daemon=by_daemon)
    for _ in replay.run(lambda _part: None):
        pass
    return replay


def same(load: Load, path: Path) -> Replay:
    """Replay, and every frame is that of the log."""
    replay = replayed(load, path)
    verdict = replay.verdict
    assert verdict.different == 0, verdict.examples
    assert verdict.service_different == 0
    sent = [row for row in path.read_text().splitlines() if " 200#" in row]
    assert verdict.compared > 3 * len(sent) > 0
    return replay


def written(tmp_path: Path, rows: list[str]) -> Path:
    path = tmp_path / "drive.log"
    path.write_text("".join(rows), encoding="ascii")
    return path


CASES = {
    "usual": Hardness(),
    "a joystick's frames come while the daemon thinks": Hardness(
        think_ns=400_000, joystick_phase_ns=100_000
    ),
    "ticks are missed": Hardness(miss=0.03),
    "clocks drift, ticks are late": Hardness(drift=2e-4, think_ns=1_000_000, late_ns=2_000_000),
    "a joystick is silent for longer than its timeout": Hardness(silent=(4.0, 4.5)),
    "all of it": Hardness(
        drift=2e-4, think_ns=1_000_000, late_ns=2_000_000, miss=0.01, silent=(4.0, 4.5)
    ),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", ["forwarder.yaml", "forwarder-robust.yaml"])
def test_every_frame_is_the_same(tmp_path: Path, name: str, case: str) -> None:
    load = loader(name)
    replay = same(load, written(tmp_path, log_of(load, 1, CASES[case], seconds=8.0)))
    assert replay.verdict.starts == 1
    assert not replay.verdict.ran_before


@pytest.mark.parametrize("phase_ns", [7_000_000, 16_000_000])
@pytest.mark.parametrize("interface", ["socketcan", "slcan"])
def test_a_joystick_is_lost_in_the_same_tick_wherever_its_frames_lie(
    tmp_path: Path, interface: str, phase_ns: int
) -> None:
    """By the stamp of its last frame; without stamps by the tick before the one that read it."""
    shipped = (ROOT / "config" / "forwarder.yaml").read_text(encoding="utf-8")
    text = shipped.replace("interface: socketcan", f"interface: {interface}")
    text = text.replace("timeout_ms: 100", "timeout_ms: 110")  # an age of whole ticks is no tie
    (tmp_path / "machine.yaml").write_text(text.replace("../dbc", str(ROOT / "dbc")))
    load = loader(str(tmp_path / "machine.yaml"))
    hard = Hardness(joystick_phase_ns=phase_ns, silent=(4.0, 4.5))
    replay = same(load, written(tmp_path, log_of(load, 1, hard, seconds=6.0)))
    assert replay.verdict.settled == 0


@pytest.mark.parametrize("name", ["forwarder-joints.yaml", "canopen-forwarder.yaml"])
def test_other_machines_are_the_same_too(tmp_path: Path, name: str) -> None:
    load = loader(name)
    verdict = replayed(load, written(tmp_path, log_of(load, 1, Hardness(), seconds=6.0))).verdict
    assert (verdict.different, verdict.service_different) == (0, 0)
    assert verdict.compared > 1000


def test_of_a_node_of_j1939_every_valve_frame_is_the_same(tmp_path: Path) -> None:
    """They come only once the address is claimed: the log looks like one of a daemon that ran
    before, and when its diagnostics are due next is not in it."""
    load = loader("j1939-forwarder.yaml")
    rows = log_of(load, 1, Hardness(), seconds=6.0)
    replay = Replay(load, look(load(), written(tmp_path, rows), {}), by_daemon=True)
    different = {d.key for _, r in replay.run(lambda _part: None) for d in r.differences}
    assert replay.verdict.ran_before
    assert replay.verdict.compared > 1000
    assert replay.verdict.different <= 6
    assert not different & {a.valve.message.sender.key for a in load().axes.values()}


def test_what_was_read_is_settled_by_what_was_sent(tmp_path: Path) -> None:
    """Frames that stand before the valve frames in the log, but were read a tick later."""
    load = loader("forwarder.yaml")
    hard = Hardness(think_ns=400_000, joystick_phase_ns=100_000)
    replay = same(load, written(tmp_path, log_of(load, 3, hard, seconds=12.0)))
    assert replay.verdict.settled > 10


def test_a_real_daemon_on_a_pc_that_was_much_too_busy(tmp_path: Path) -> None:
    """51 missed deadlines, a stall, and a recording that begins while the daemon runs."""
    log, file = unpack(DATA / "stalled.zip", tmp_path)
    replay = same(loader(str(file)), log)
    assert replay.verdict.ran_before
    assert replay.verdict.starts == 0


def test_a_log_that_begins_while_the_daemon_runs(tmp_path: Path) -> None:
    load = loader("forwarder.yaml")
    rows = log_of(load, 1, Hardness(), seconds=8.0)
    first = next(i for i, row in enumerate(rows) if " 200#" in row)
    replay = same(load, written(tmp_path, rows[first + 43 :]))
    assert replay.verdict.ran_before


def test_a_log_may_end_within_a_tick(tmp_path: Path) -> None:
    load = loader("forwarder.yaml")
    rows = log_of(load, 1, Hardness(), seconds=4.0)
    valve = max(i for i, row in enumerate(rows[:-20]) if " 200#" in row)
    same(load, written(tmp_path, rows[: valve + 1]))


def test_two_daemons_one_after_the_other(tmp_path: Path) -> None:
    load = loader("forwarder.yaml")
    rows = log_of(load, 1, Hardness(), seconds=4.0)
    later = [
        row.replace("(176375000", "(176375002") for row in log_of(load, 2, Hardness(), seconds=4.0)
    ]
    replay = same(load, written(tmp_path, rows + later))
    assert replay.verdict.starts == 2


def test_a_daemon_that_is_killed_and_starts_again(tmp_path: Path) -> None:
    load = loader("forwarder.yaml")
    rows = log_of(load, 1, Hardness(), seconds=4.0)
    killed = rows[: len(rows) - 200]
    later = [
        row.replace("(176375000", "(176375002") for row in log_of(load, 2, Hardness(), seconds=4.0)
    ]
    replay = same(load, written(tmp_path, killed + later))
    assert replay.verdict.starts == 2


@pytest.mark.parametrize("opens_s", [0.003, 0.15])
@pytest.mark.parametrize(("seed", "stands_s", "reload_s"), [(4, math.inf, 2.0), (1, 5.0, 5.3)])
def test_a_daemon_that_reads_its_files_again(
    tmp_path: Path, seed: int, stands_s: float, reload_s: float, opens_s: float
) -> None:
    """At rest, and tripped by a standstill; quickly, and so slowly that what waited is too old."""
    load = loader("forwarder.yaml")
    hard = Hardness(stands_s=stands_s, reload=(reload_s, opens_s))
    replay = same(load, written(tmp_path, log_of(load, seed, hard, seconds=9.0)))
    assert replay.verdict.starts == 2


# -- differences -------------------------------------------------------------------------------


def changed(rows: list[str], of: str, at: int, change: Callable[[str], str]) -> list[str]:
    """The same with the frame number ``at`` of an id changed."""
    places = [i for i, row in enumerate(rows) if f" {of}#" in row]
    place = places[at]
    return [*rows[:place], change(rows[place]), *rows[place + 1 :]]


def test_one_byte_that_is_not_the_same_is_found_with_its_time(tmp_path: Path) -> None:
    load = loader("forwarder.yaml")
    rows = log_of(load, 1, Hardness(), seconds=6.0)

    def other(row: str) -> str:
        at = row.index("#") + 1
        return f"{row[:at]}{int(row[at : at + 2], 16) ^ 1:02X}{row[at + 2 :]}"

    wrong = changed(rows, VALVE, 150, other)
    verdict = replayed(load, written(tmp_path, wrong)).verdict
    assert verdict.different == 1
    ((time_ns, difference),) = verdict.examples
    assert difference.key == ("crane", 0x200, False)
    assert (
        f"({time_ns // 10**9}.{time_ns % 10**9 // 1000:06d})"
        in rows[next(i for i, (a, b) in enumerate(zip(rows, wrong, strict=True)) if a != b)]
    )
    assert verdict.last_ns == time_ns


@pytest.mark.parametrize("of", [STATUS, "201"])
def test_a_frame_that_is_missing_is_told_and_nothing_else(tmp_path: Path, of: str) -> None:
    load = loader("forwarder.yaml")
    rows = changed(log_of(load, 1, Hardness(), seconds=6.0), of, 20, lambda _row: "")
    verdict = replayed(load, written(tmp_path, rows)).verdict
    assert 1 <= verdict.different <= 3
    assert verdict.examples[0][1].key == ("crane", int(of, 16), False)


def test_another_deployment_is_not_the_same(tmp_path: Path) -> None:
    path = written(tmp_path, log_of(loader("forwarder.yaml"), 1, Hardness(), seconds=6.0))
    verdict = replayed(loader("forwarder-robust.yaml"), path).verdict
    assert verdict.different > 50


# -- logs without a daemon ---------------------------------------------------------------------


def test_valve_frames_of_another_controller_are_no_ticks(tmp_path: Path) -> None:
    load = loader("forwarder.yaml")
    rows = log_of(load, 1, Hardness(), seconds=4.0)
    alone = [row for row in rows if " 11" in row]
    found = look(load(), written(tmp_path, alone), {})
    assert not found.daemon
    assert found.why_not == "no valve frames of this deployment"
    without_status = [row for row in rows if " 30" not in row]
    found = look(load(), written(tmp_path, without_status), {})
    assert "valve frames without status" in found.why_not
    valves = [row for row in rows if " 200#" in row]
    slower = [row for row in rows if row not in valves or valves.index(row) % 5 == 0]
    found = look(load(), written(tmp_path, slower), {})
    assert re.search(r"0x200 every (99|100)\.. ms, not 20 ms: those of another", found.why_not)


def test_a_log_without_joystick_frames_is_told_with_what_it_has(tmp_path: Path) -> None:
    load = loader("forwarder.yaml")
    rows = [row for row in log_of(load, 1, Hardness(), seconds=4.0) if " 11" not in row]
    replay = replayed(load, written(tmp_path, rows))
    with pytest.raises(
        LogError, match=r"none of its joystick messages \(JoystickLeft, id 0x110 on"
    ):
        replay.check_joysticks()


def test_one_missing_joystick_is_a_warning(tmp_path: Path) -> None:
    load = loader("forwarder.yaml")
    rows = [row for row in log_of(load, 1, Hardness(), seconds=4.0) if " 111#" not in row]
    replay = replayed(load, written(tmp_path, rows))
    replay.check_joysticks()
    assert list(replay.warnings()) == ["no joystick frame of JoystickRight, id 0x111 on crane"]


def test_a_log_that_is_cut_off_is_replayed_up_to_there(tmp_path: Path) -> None:
    load = loader("forwarder.yaml")
    rows = log_of(load, 1, Hardness(), seconds=4.0)
    path = written(tmp_path, [*rows[:900], rows[900][:20]])
    replay = replayed(load, path)
    assert replay.verdict.different == 0
    (warning,) = replay.warnings()
    assert f"{path}:901: the log is cut off" in warning
    assert warning.endswith("replayed up to there")


def test_a_clock_ticks_from_the_first_joystick_frame_to_the_last_frame(tmp_path: Path) -> None:
    load = loader("forwarder.yaml")
    rows = log_of(load, 1, replace(Hardness(), before_s=0.0), seconds=4.0)
    path = written(tmp_path, [row for row in rows if " 11" in row])
    replay = Replay(load, look(load(), path, {}), by_daemon=False)
    ticks = [(tick, result) for tick, result in replay.run(lambda _part: None)]
    assert [tick.number for tick, _ in ticks] == list(range(len(ticks)))
    assert len(ticks) == pytest.approx(200, abs=2)
    assert replay.heard["crane", 0x110, False] == sum(" 110#" in row for row in rows)
    assert any(row.sent for _, result in ticks for row in result.rows.values())
