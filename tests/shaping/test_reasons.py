"""Every reason and state has its words."""

from canshaper.shaping.reasons import REASON_TEXTS, STATE_TEXTS
from canshaper.shaping.states import Reason, State


def test_every_reason_has_words_and_a_cause() -> None:
    assert set(REASON_TEXTS) == set(Reason)
    assert all(text.words and text.cause for text in REASON_TEXTS.values())


def test_every_state_has_words_and_says_what_the_valve_gets() -> None:
    assert set(STATE_TEXTS) == set(State)
    assert all(text.words and text.valve and text.meaning for text in STATE_TEXTS.values())
