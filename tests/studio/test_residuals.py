"""Swing that the filter in force leaves, over the length of the pendulum."""

import json
from typing import Any
from urllib.request import urlopen

import pytest

from canshaper.cli.common import loader
from canshaper.studio.seen import residuals
from tests.studio.conftest import Studio
from tests.studio.page import WAIT_S

PERIOD = "axes.slew.sway.period_s"


def best_m(curve: dict[str, Any]) -> float:
    """Length at which least is left."""
    return float(min(zip(curve["left"], curve["lengths_m"], strict=True))[1])


def test_least_is_left_near_the_length_that_the_filter_believes() -> None:
    deployment = loader("forwarder-robust.yaml")()
    before = residuals(deployment, {})
    assert list(before) == ["slew", "near_far"]  # lift excites no swing
    for curve in before.values():
        assert curve["believes"] == curve["file"]
        assert best_m(curve) == pytest.approx(curve["file"], rel=0.051)
        assert curve["left"][0] > 0.2
    assert before["near_far"]["file"] == pytest.approx(1.2, abs=0.05)
    now = residuals(deployment, {PERIOD: 1.2 * deployment.axes["slew"].config.sway.period_s})
    assert now["near_far"] == before["near_far"]
    slew = now["slew"]
    assert slew["file"] == before["slew"]["file"]
    assert slew["believes"] == pytest.approx(1.44 * slew["file"], rel=1e-3)
    assert best_m(slew) == pytest.approx(slew["believes"], rel=0.06)


def test_an_axis_with_several_filters_has_no_curve() -> None:
    assert residuals(loader("j1939-profiles.yaml")(), {}).keys() <= {"lift"}


@pytest.mark.slow
def test_the_page_gets_those_of_the_sliders(shared: Studio) -> None:
    def slew() -> dict[str, Any]:
        with urlopen(f"http://{shared.host}/residuals.json", timeout=WAIT_S) as answer:
            residuals: dict[str, Any] = json.load(answer)["slew"]
            return residuals

    before = slew()
    with shared.page() as page:
        page.drive()
        page.send(slide="length", to=1.5)
        page.until(lambda s: s["sliders"]["length"] == 1.5, "slider")
        assert slew()["believes"] == pytest.approx(1.5 * before["believes"], rel=1e-3)
        page.send(slide="length", to=1.0)
        page.until(lambda s: s["sliders"]["length"] == 1.0, "slider")
