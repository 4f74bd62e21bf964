"""A DBC file of a whole machine: as many messages as there are, and a deployment of a few."""

from pathlib import Path

import pytest

from canshaper.machine.binding import load_deployment
from canshaper.machine.database import DbcFile
from tests.hostile.inputs import with_dbc
from tests.hostile.run import run
from tests.machine.large_dbc import large
from tests.rigs.files import ROOT, Machine

COUNT = 5000
MOST_MB = 80


@pytest.fixture(scope="module")
def text() -> str:
    return large(COUNT)


@pytest.mark.slow
@pytest.mark.processes
def test_a_deployment_starts_in_little_memory(text: str) -> None:
    """benchmarks/large_dbc.py shows what cantools takes for all of them."""
    ran = run(with_dbc("a.dbc", text))
    assert ran.code == 0, ran.text
    assert "not used" not in ran.text
    assert ran.peak_mb < MOST_MB


def test_only_its_messages_are_parsed(machine: Machine, text: str) -> None:
    few = {m.name for m in machine.load().messages.all()}
    machine.dbc = text
    messages = machine.load().messages
    assert {m.name for m in messages.all()} == few
    assert len(messages.ids()) == COUNT + 16
    assert (0x0CF00000 + COUNT - 1, True) in messages.ids()


@pytest.mark.parametrize(
    "path",
    [p for p in sorted((ROOT / "config").glob("*.yaml")) if not p.name.startswith("crane-")],
    ids=lambda path: path.name,
)
def test_each_message_that_a_deployment_names_is_parsed_at_once(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(DbcFile, "read")
    deployment = load_deployment(path)
    used = {m.name for messages in deployment.on_bus.values() for m in messages}
    assert {m.name for m in deployment.messages.all()} == used
