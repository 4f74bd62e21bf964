"""The driver's seat: what a page may do to the joysticks, and when it loses them."""

import math
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.errors import PageMessageError
from canshaper.studio.cab import MOST_PRESSES, PRESS_S, RELEASE_S, RESET_S, SILENT_S, Cab
from canshaper_sim.hand import Held

AXES = ("slew", "near_far", "lift")
NEUTRAL = dict.fromkeys(AXES, 0.0)


def deflected(held: Held) -> dict[str, float]:
    """The joysticks that are not in neutral."""
    return {name: value for name, value in held.joysticks.items() if value}


class Seat:
    """A cab with a driver whose joystick was seen in neutral, enabled."""

    def __init__(self) -> None:
        self.reported: list[str] = []
        self.cab = Cab(AXES, self.reported.append)
        self.cab.take(1, 0.9)
        self.cab.joysticks(1, NEUTRAL, 0.9)
        self.cab.press_enable(1, True, 0.9)


@pytest.fixture
def seat() -> Seat:
    return Seat()


def test_no_one_drives_at_the_start() -> None:
    cab = Cab(AXES, print)
    cab.joysticks(1, {"slew": 1.0}, 0.0)
    cab.press_enable(1, True, 0.0)
    held = cab.held(0.1)
    assert (deflected(held), held.enable) == ({}, False)


def test_the_driver_moves_the_joysticks(seat: Seat) -> None:
    seat.cab.joysticks(1, {"slew": 0.5, "lift": -1}, 1.02)
    held = seat.cab.held(1.03)
    assert deflected(held) == {"slew": 0.5, "lift": -1.0}
    assert held.enable and held.anti_sway and not held.reset


def test_another_page_moves_nothing(seat: Seat) -> None:
    seat.cab.joysticks(1, {"slew": 0.5}, 1.02)
    seat.cab.joysticks(2, {"slew": -1.0}, 1.03)
    seat.cab.press_enable(2, False, 1.03)
    seat.cab.press_reset(2, 1.03)
    seat.cab.switch_anti_sway(2, False)
    held = seat.cab.held(1.04)
    assert deflected(held) == {"slew": 0.5}
    assert held.enable and held.anti_sway and not held.reset


def test_a_joystick_counts_only_from_neutral() -> None:
    cab = Cab(AXES, print)
    cab.take(1, 0.0)
    cab.press_enable(1, True, 0.0)
    cab.joysticks(1, {"slew": 0.5}, 0.02)
    assert deflected(cab.held(0.02)) == {}
    cab.joysticks(1, {"slew": 0.01, "lift": 0.5}, 0.04)
    assert deflected(cab.held(0.04)) == {}
    cab.joysticks(1, NEUTRAL, 0.06)
    cab.joysticks(1, {"slew": 0.5}, 0.08)
    assert deflected(cab.held(0.08)) == {"slew": 0.5}


def test_a_silent_page_lets_go_then_enable_is_released(seat: Seat) -> None:
    seat.cab.joysticks(1, {"slew": 0.5}, 1.0)
    assert deflected(seat.cab.held(1.0 + SILENT_S - 0.01)) == {"slew": 0.5}
    silent = 1.0 + SILENT_S + 0.01
    held = seat.cab.held(silent)
    assert (deflected(held), held.enable) == ({}, True)
    assert seat.cab.held(silent + RELEASE_S - 0.01).enable
    held = seat.cab.held(silent + RELEASE_S)
    assert (deflected(held), held.enable) == ({}, False)
    assert seat.reported == ["page 1 is silent; joysticks in neutral", "enable released"]


def test_a_page_that_is_back_in_time_keeps_enable_but_not_its_joystick(seat: Seat) -> None:
    seat.cab.joysticks(1, {"slew": 0.5}, 1.0)
    seat.cab.joysticks(1, {"slew": 0.5}, 1.0 + SILENT_S + 0.1)
    assert deflected(seat.cab.held(1.31)) == {}
    seat.cab.joysticks(1, NEUTRAL, 1.4)
    seat.cab.joysticks(1, {"slew": 0.5}, 1.42)
    assert deflected(seat.cab.held(1.43)) == {"slew": 0.5}
    for step in range(200):  # goes on sending
        seat.cab.joysticks(1, NEUTRAL, 1.5 + 0.05 * step)
    assert seat.cab.held(11.5).enable


def test_a_second_driver_releases_enable(seat: Seat) -> None:
    seat.cab.joysticks(1, {"slew": 0.5}, 1.0)
    seat.cab.take(2, 1.0)
    assert deflected(seat.cab.held(1.0)) == {}
    seat.cab.joysticks(1, {"slew": 0.5}, 1.02)
    seat.cab.joysticks(2, NEUTRAL, 1.02)
    seat.cab.press_enable(2, True, 1.02)  # too early: it is about to be released
    for step in range(1, 150):
        seat.cab.joysticks(2, NEUTRAL, 1.02 + 0.02 * step)
    assert not seat.cab.held(1.0 + RELEASE_S).enable
    seat.cab.press_enable(2, True, 4.0)
    seat.cab.joysticks(2, {"slew": -0.5}, 4.01)
    held = seat.cab.held(4.02)
    assert (deflected(held), held.enable) == ({"slew": -0.5}, True)


def test_a_page_that_goes_leaves_the_joysticks_in_neutral(seat: Seat) -> None:
    seat.cab.joysticks(1, {"slew": 0.5}, 1.0)
    seat.cab.leave(1, 1.0)
    held = seat.cab.held(1.0)
    assert (deflected(held), held.enable, seat.cab.driver) == ({}, True, None)
    assert not seat.cab.held(1.0 + RELEASE_S).enable


def test_after_nonsense_the_joysticks_have_to_be_in_neutral_and_enable_goes(seat: Seat) -> None:
    seat.cab.joysticks(1, {"slew": 0.5}, 1.0)
    seat.cab.nonsense(1, 1.01)
    seat.cab.joysticks(1, {"slew": 0.5}, 1.02)
    assert deflected(seat.cab.held(1.03)) == {}
    for step in range(200):
        seat.cab.joysticks(1, NEUTRAL, 1.04 + 0.02 * step)
    assert not seat.cab.held(5.05).enable


def test_release_is_at_once(seat: Seat) -> None:
    seat.cab.joysticks(1, {"slew": 0.5}, 1.0)
    seat.cab.press_enable(1, False, 1.0)
    held = seat.cab.held(1.0)
    assert (deflected(held), held.enable) == ({}, False)


def test_each_press_for_the_next_profile_is_a_press_of_its_own(seat: Seat) -> None:
    seat.cab.press_next_profile(2, 1.0)
    assert not seat.cab.held(1.0).next_profile
    for _ in range(3 * MOST_PRESSES):
        seat.cab.press_next_profile(1, 1.0)
    held = [seat.cab.held(1.0 + 0.02 * tick).next_profile for tick in range(200)]
    presses = sum(one and not before for before, one in pairwise([False, *held]))
    assert presses == MOST_PRESSES
    assert held[:5] == [True] * 5
    assert held[5:10] == [False] * 5
    seat.cab.press_next_profile(1, 5.0)
    assert seat.cab.held(5.0).next_profile
    assert not seat.cab.held(5.0 + 1.1 * PRESS_S).next_profile


def test_reset_is_held_for_a_moment(seat: Seat) -> None:
    seat.cab.press_reset(1, 1.0)
    assert seat.cab.held(1.0).reset
    assert seat.cab.held(1.0 + 0.9 * RESET_S).reset
    assert not seat.cab.held(1.0 + RESET_S).reset


def test_anti_sway_is_switched_and_reported_once(seat: Seat) -> None:
    seat.cab.switch_anti_sway(1, False)
    seat.cab.switch_anti_sway(1, False)
    assert not seat.cab.held(0.0).anti_sway
    assert seat.reported == ["anti-sway switched off"]


@pytest.mark.parametrize(
    "joysticks",
    [
        {"slew": 1.01},
        {"slew": -1.01},
        {"slew": math.nan},
        {"slew": math.inf},
        {"slew": True},
        {"slew": "0.5"},
        {"slew": None},
        {"slew": [0.5]},
        {"slew": 10**400},
        {"boom": 0.0},
    ],
)
def test_what_is_no_position_is_refused_and_moves_nothing(
    seat: Seat, joysticks: dict[str, Any]
) -> None:
    with pytest.raises(PageMessageError, match=r"expected -1 to 1, got|there are"):
        seat.cab.joysticks(1, joysticks, 1.02)
    assert deflected(seat.cab.held(1.03)) == {}


@given(
    st.lists(
        st.tuples(
            st.sampled_from(
                ["take", "leave", "joysticks", "enable", "release", "nonsense", "wait"]
            ),
            st.integers(1, 3),
            st.floats(0.0, 0.5),
            st.sampled_from([0.0, 0.4, -1.0]),
        ),
        max_size=60,
    )
)
def test_joysticks_are_never_those_of_a_page_that_is_silent_or_does_not_drive(
    steps: list[tuple[str, int, float, float]],
) -> None:
    """Whatever pages do: a deflection that counts was sent by the driver within the last moment."""
    cab, now, last = Cab(AXES, lambda _: None), 0.0, {}
    for what, page, passed, joystick in steps:
        now += passed
        if what == "take":
            cab.take(page, now)
        elif what == "leave":
            cab.leave(page, now)
        elif what == "joysticks":
            cab.joysticks(page, {"slew": joystick}, now)
            last[page] = (now, joystick)
        elif what in ("enable", "release"):
            cab.press_enable(page, what == "enable", now)
        elif what == "nonsense":
            cab.nonsense(page, now)
        held = cab.held(now)
        if held.joysticks.get("slew", 0.0):
            at, sent = last[cab.driver or 0]
            assert sent == held.joysticks["slew"]
            assert now - at <= SILENT_S
