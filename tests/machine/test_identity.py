"""The digest of what runs: equal for equal content, another for any other byte."""

import os
import shutil
from hashlib import sha256
from importlib.metadata import EntryPoint, distribution
from pathlib import Path

import pytest

from canshaper.codec.frame import Frame
from canshaper.commissioning.monitor.state import Monitor
from canshaper.machine import identity as module
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.recording.listen import ReceivedFrame
from canshaper.shaping import transfer
from canshaper.shaping.registry import ADDED
from tests.rigs.files import ROOT
from tests.rigs.sent import status_frame

SHIPPED = [
    path.name
    for path in sorted((ROOT / "config").glob("*.yaml"))
    if "axes:" in path.read_text(encoding="utf-8")
]


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    shutil.copytree(ROOT / "config", tmp_path / "config")
    shutil.copytree(ROOT / "dbc", tmp_path / "dbc")
    return tmp_path / "config" / "two-cranes.yaml"


def digest(path: Path) -> int:
    return load_deployment(path).identity.digest


def test_a_copy_elsewhere_is_the_same(machine: Path) -> None:
    assert digest(machine) == digest(ROOT / "config" / "two-cranes.yaml")


@pytest.mark.parametrize("file", ["config/two-cranes.yaml", "dbc/forwarder.dbc", "dbc/rotator.dbc"])
def test_a_space_more_in_any_file_is_another(machine: Path, file: str) -> None:
    before = load_deployment(machine).identity
    with (machine.parents[1] / file).open("a", encoding="utf-8") as changed:
        changed.write(" \n")
    after = load_deployment(machine).identity
    assert after.digest != before.digest
    assert sum(a != b for a, b in zip(before.lines(), after.lines(), strict=True)) == 2


def test_a_file_that_is_not_used_changes_nothing(machine: Path) -> None:
    before = digest(machine)
    (machine.parent / "forwarder.yaml").write_text("", encoding="utf-8")
    assert digest(machine) == before


def test_another_program_is_another(machine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = digest(machine)
    monkeypatch.setattr(module, "program_sha256", lambda: "0" * 64)
    assert digest(machine) != before


def test_the_program_is_what_lies_in_its_modules(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "part").mkdir()
    (tmp_path / "part" / "a.py").write_text("x = 1\n", encoding="utf-8")
    (tmp_path / "b.py").write_text("", encoding="utf-8")
    monkeypatch.setattr(module, "PACKAGE", tmp_path)
    hashed = module.program_sha256.__wrapped__
    first = hashed()
    (tmp_path / "notes.txt").write_text("no module", encoding="utf-8")
    assert hashed() == first
    (tmp_path / "part" / "a.py").write_text("x = 2\n", encoding="utf-8")
    second = hashed()
    (tmp_path / "part" / "a.py").rename(tmp_path / "part" / "c.py")
    assert len({first, second, hashed()}) == 3


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_deployment_sends_it(name: str) -> None:
    deployment = load_deployment(ROOT / "config" / name)
    status = deployment.identity_status
    assert status is not None
    frame = status_frame(status, deployment.identity.digest)
    assert status.decode(frame.data) == {"Digest": deployment.identity.digest}
    assert frame[1:3] in deployment.routing.buses[frame.bus].sent
    assert status.decode(frame.data[:1]) is None


def said(deployment: Deployment, *digests: int) -> list[str]:
    """Note of a monitor on these digests on the bus."""
    status = deployment.identity_status
    assert status is not None
    monitor = Monitor(deployment)
    for i, value in enumerate(digests):
        frame: Frame = status_frame(status, value)
        monitor.receive(ReceivedFrame(i, frame.bus, "can0", *frame[1:], ""))
    return [event.text for event in monitor.events]


def test_a_monitor_compares_it_with_its_own_files() -> None:
    deployment = load_deployment(ROOT / "config" / "forwarder.yaml")
    ours = deployment.identity.digest
    other = ours ^ 1
    first, second = said(deployment, ours, ours, other, other)
    assert first == f"daemon runs digest {ours:#06x}"
    assert f"daemon runs digest {other:#06x}, not {ours:#06x}" in second


def test_a_filter_of_another_package_is_named_with_its_module(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    point = EntryPoint("mine", "canshaper.shaping.transfer:Off", "canshaper.shapers")
    monkeypatch.setitem(ADDED, "mine", point)
    (line,) = module.filter_lines(["off", "mine"])
    digest = sha256(Path(str(transfer.__file__)).read_bytes()).hexdigest()
    assert line == f"filter=sha256:{digest} kind=mine package={point.value}"


def test_a_filter_is_named_with_package_and_version(monkeypatch: pytest.MonkeyPatch) -> None:
    owner = distribution("pytest")
    point = EntryPoint("mine", "canshaper.shaping.transfer:Off", "canshaper.shapers")
    vars(point)["dist"] = owner
    monkeypatch.setitem(ADDED, "mine", point)
    (line,) = module.filter_lines(["mine"])
    assert line.endswith(f" kind=mine package=pytest {owner.version}")


@pytest.mark.parametrize(("gone", "matters"), [("__pycache__", False), ("room", True)])
def test_compiled_modules_that_come_and_go_are_no_part_of_the_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, gone: str, matters: bool
) -> None:
    """Another program that starts makes them; modules that cannot be read are a fault."""
    for name in ("one.py", "room/two.py", "room/__pycache__/two.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(name)
    monkeypatch.setattr(module, "PACKAGE", tmp_path)
    digest, scandir = module.program_sha256.__wrapped__, os.scandir

    def racing(path: Path | str) -> object:
        if Path(path).name == gone:
            raise FileNotFoundError(2, "No such file or directory", str(path))
        return scandir(path)

    before = digest()
    monkeypatch.setattr(os, "scandir", racing)
    if matters:
        with pytest.raises(FileNotFoundError):
            digest()
    else:
        assert digest() == before
