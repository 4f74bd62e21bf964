"""Names that look like one that is wrong: in keys, messages and signals of a file."""

from pathlib import Path

import pytest

from canshaper.errors import ConfigError, did_you_mean, there_are
from canshaper.machine.binding import load_deployment

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("name", "end"),
    [
        ("joistick", "; did you mean joystick?"),
        ("JoystickLEFT", "; did you mean JoystickLeft?"),
        ("Left", ""),
        ("", ""),
    ],
)
def test_a_name_like_it_is_named(name: str, end: str) -> None:
    assert did_you_mean(name, ("joystick", "JoystickLeft", "NearFarCommand")) == end


def test_of_many_names_only_the_nearest_are_listed() -> None:
    few = [f"Valve{i:02}" for i in range(20)]
    assert there_are("Valve", few) == f"; there are {', '.join(few)}; did you mean Valve19?"
    assert there_are("Valve", []) == "; there are none"
    many = [*few, *(f"Pump{i:03}" for i in range(140)), "JoystickLeft", "JoystickRight"]
    said = there_are("JoystikLeft", many)
    assert said.startswith("; there are 162, such as JoystickLeft, JoystickRight")
    assert said.endswith("; did you mean JoystickLeft?")
    assert len(said) < 120
    nothing_like_it = "; there are 162, such as Valve00, Valve01, Valve02, Valve03, Valve04"
    assert there_are("###", many) == nothing_like_it


@pytest.mark.parametrize(
    ("old", "new", "end"),
    [
        ("timeout_ms: 100 #", "timeoutms: 100 #", "got an unknown one; did you mean timeout_ms?"),
        ("message: JoystickLeft", "message: JoystikLeft", "; did you mean JoystickLeft?"),
        ("signal: NearFar,", "signal: NearFaar,", "; did you mean NearFar?"),
    ],
)
def test_every_kind_of_name_in_a_file(tmp_path: Path, old: str, new: str, end: str) -> None:
    text = (ROOT / "config" / "forwarder.yaml").read_text(encoding="utf-8")
    file = tmp_path / "machine.yaml"
    changed = text.replace("../dbc", str(ROOT / "dbc")).replace(old, new, 1)
    file.write_text(changed, encoding="utf-8")
    with pytest.raises(ConfigError) as error:
        load_deployment(file)
    assert any(str(problem).endswith(end) for problem in error.value.problems)
