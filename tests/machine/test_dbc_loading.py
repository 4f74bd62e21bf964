"""Reading of the DBC files of a deployment: which are refused, and where that is said."""

from pathlib import Path

import pytest

from canshaper.errors import ConfigError
from canshaper.machine.binding import load_deployment
from tests.rigs.files import Machine


def inside_problems(machine: Machine, directory: Path) -> list[str]:
    """Problems of the machine's deployment as a part of a bundle in a directory."""
    with pytest.raises(ConfigError) as caught:
        load_deployment(machine.directory / "machine.yaml", inside=directory)
    return [str(p).replace(f"{machine.directory}/", "") for p in caught.value.problems]


def test_only_the_file_outside_of_a_bundle_is_named(machine: Machine) -> None:
    machine.load()
    bundle = machine.directory / "bundle"
    bundle.mkdir()
    (bundle / "inside.dbc").write_text("", encoding="utf-8")
    line = machine.in_yaml("[machine.dbc]", "[bundle/inside.dbc, machine.dbc, none.dbc]")
    (machine.directory / "machine.yaml").write_text(machine.yaml, encoding="utf-8")
    assert inside_problems(machine, bundle) == [
        f"machine.yaml:{line}: dbc.1: expected a file of the bundle, got 'machine.dbc'"
    ]


def test_all_files_together_have_a_size(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    machine.load()
    size = (machine.directory / "machine.dbc").stat().st_size
    (machine.directory / "other.dbc").write_text("hello", encoding="cp1252")
    line = machine.in_yaml("[machine.dbc]", "[none.dbc, machine.dbc, other.dbc]")
    monkeypatch.setattr("canshaper.machine.lookup.MOST_BYTES", size + 4)
    assert machine.problems() == [
        f"machine.yaml:{line}: dbc: expected {size + 4} bytes at most in all, got {size + 5}"
    ]


def test_files_of_exactly_the_size_are_read(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine.load()
    size = (machine.directory / "machine.dbc").stat().st_size
    monkeypatch.setattr("canshaper.machine.lookup.MOST_BYTES", size)
    assert len(machine.load().messages.files) == 1


def test_too_many_messages_are_refused_before_the_next_file(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    line = machine.in_yaml("[machine.dbc]", "[machine.dbc, none.dbc]")
    monkeypatch.setattr("canshaper.machine.database.MOST_MESSAGES", 14)
    assert machine.problems() == [
        f"machine.yaml:{line}: dbc: expected 14 messages in all at most, got 16"
    ]
