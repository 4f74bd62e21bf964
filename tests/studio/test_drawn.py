"""Which crane the page draws: by what hangs there, and by what its file says."""

import pytest

from canshaper.shaping.states import Reason, State
from canshaper.studio.server import drawn_of
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.plant import PlantNode
from tests.rigs.files import CONFIG, read
from tests.studio.test_view import Watched


def test_a_bridge_crane_has_a_trolley_and_a_load() -> None:
    """A model lags behind its trolley: that is negative on both axes."""
    watched = Watched("bridge-crane")
    predicted = [watched.status(State.ACTIVE, Reason.JOYSTICK_MOVED, 3.0, "bridge")]
    assert watched.receive(predicted)["sway"] == (-3.0, 0.0)
    shown = watched.receive(watched.sway(2.0, -1.0))
    assert shown["sway"] == pytest.approx((2.0, -1.0), abs=0.01)
    assert shown["trolley"] == (0.0, 0.0, 8.0)
    assert shown["measured"] and shown["crane"] and shown["pose"] is None


def test_a_load_on_a_sling_hangs_as_the_crane_says() -> None:
    watched = Watched("bridge-crane-hook")
    assert watched.view.values(0.0)["sling"] is None
    shown = watched.receive(watched.sway(2.0, -1.0))
    assert shown["sling"] == pytest.approx((2.0, -1.0), abs=0.02)  # with the rope at the start
    hall = drawn_of(changed_parameters([], watched.deployment), watched.deployment)["hall"]
    assert (hall["rope"], hall["sling"]) == (20.0, 4.0)


@pytest.mark.parametrize(
    ("name", "drawn"), [("excavator", "excavator"), ("multicopter", "multicopter")]
)
def test_what_a_file_says_is_drawn(name: str, drawn: str) -> None:
    """Of a multicopter that hovers in the picture, as wide as its rope may swing."""
    deployment = read(CONFIG / f"{name}.yaml")
    said = drawn_of(changed_parameters([], deployment), deployment)
    assert said["drawn"] == drawn
    hall = {"runway": 10.0, "span": 10.0, "rope": 5.0, "sling": 0.0}
    assert said["hall"] == (hall if drawn == "multicopter" else None)


@pytest.mark.parametrize(("name", "rope_m"), [("tower-crane", 30.0), ("telehandler", 8.0)])
def test_a_crane_with_a_rope_at_its_tip_is_drawn_with_what_it_says(
    name: str, rope_m: float
) -> None:
    watched = Watched(name)
    shown = watched.receive(PlantNode(watched.deployment).feedback())
    drawn = drawn_of(changed_parameters([], watched.deployment), watched.deployment)
    assert shown["rope"] == pytest.approx(rope_m, abs=0.01)
    boom, (_, radius_m, height_m) = drawn["boom"], shown["pose"]
    assert boom["straight"] and drawn["hall"] is None
    assert radius_m <= boom["main_boom_m"] + boom["outer_boom_m"]
    if name == "tower-crane":
        assert height_m == pytest.approx(boom["pillar_m"], abs=0.01)
