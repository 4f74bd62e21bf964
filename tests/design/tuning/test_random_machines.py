"""The verdict of ``check`` on 200 random machines, against a drive of each."""

import pytest

from tests.design.tuning.random_machines import COUNT, judged


@pytest.mark.study
def test_the_verdict_is_what_a_drive_shows() -> None:
    results = [judged(seed) for seed in range(COUNT)]
    wrong = [str(one) for one in results if not one.agrees]
    assert len(wrong) <= 0.05 * COUNT, wrong
    assert all(one.left <= 0.15 for one in results if one.verdict.word == "good")
    assert all(one.machine.damping_ratio > 0.5 for one in results if not one.agrees)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "word"), [(1, "poor"), (6, "good"), (8, "poor"), (101, "useless")]
)
def test_each_word_is_what_a_drive_shows(seed: int, word: str) -> None:
    one = judged(seed)
    assert (one.verdict.word, one.agrees) == (word, True)
    assert one.left == pytest.approx(one.verdict.left, abs=0.01)
