"""The comparison of sample logs finds what it is for."""

from pathlib import Path

import can
import pytest

from tests.recording import samples

START_S = 1_763_750_000.0


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "drive.log"
    with can.Logger(path) as writer:
        for number in range(20):
            data = bytes((number, 1, 2))
            writer.on_message_received(
                can.Message(START_S + number / 100, 0x110, is_extended_id=False, data=data)
            )
    return path


def test_what_both_read_is_equal(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert samples.main([str(log.parent)]) == 0
    assert capsys.readouterr().out == "1 logs: {'equal': 1}\n"


@pytest.mark.parametrize("fault", ["lost", "changed", "late", "invented"])
def test_a_difference_is_reported(log: Path, monkeypatch: pytest.MonkeyPatch, fault: str) -> None:
    def wrong(path: Path) -> tuple[list[samples.Timed], str]:
        rows, refused = samples.theirs(path)
        time_s, (can_id, extended, data) = rows[7]
        if fault == "lost":
            rows.pop()
        elif fault == "changed":
            rows[7] = time_s, (can_id, extended, data[::-1])
        elif fault == "late":
            rows[7] = time_s + 10 * samples.ROUNDING_S, rows[7][1]
        else:
            rows.append(rows[7])
        return rows, refused

    monkeypatch.setattr(samples, "ours", wrong)
    assert samples.main([str(log.parent)]) == 1


def test_no_log_is_no_success(tmp_path: Path) -> None:
    assert samples.main([str(tmp_path)]) == 1


def test_a_clock_that_is_set_back_ends_ours(log: Path) -> None:
    log.write_text(log.read_text() + log.read_text())
    verdict, reason = samples.compared(log)
    assert (verdict, "20 of 40 frames" in reason) == ("stricter", True)
