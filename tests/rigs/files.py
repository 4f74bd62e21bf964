"""A machine on disk, made from the shipped one by changing deployment and DBC file."""

import re
from functools import cache
from pathlib import Path

import pytest

from canshaper.errors import ConfigError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "config"
_shipped = cache(load_deployment)


def read(path: Path) -> Deployment:
    """A deployment; one of config/ is read once by each process, since no test changes it."""
    return _shipped(path) if path.parent == CONFIG else load_deployment(path)


def text_of(file: Path | str) -> str:
    """Text of a deployment, of config/ by its name; its DBC files are found from anywhere."""
    path = (CONFIG / file).with_suffix(".yaml")
    return path.read_text(encoding="utf-8").replace("../dbc", str(ROOT / "dbc"))


def machine_file(folder: Path, file: Path | str, *changes: tuple[str, str], more: str = "") -> Path:
    """Write a deployment with these texts replaced, everywhere that they stand, and more lines."""
    text = text_of(file)
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    path = folder / "machine.yaml"
    path.write_text(text + more, encoding="utf-8")
    return path


def line_of(file: Path, text: str) -> int:
    """Line of a file that has this first."""
    return next(n for n, line in enumerate(file.read_text().splitlines(), 1) if text in line)


def problems(file: Path) -> list[str]:
    """Every problem of a deployment, without the folder."""
    with pytest.raises(ConfigError) as caught:
        load_deployment(file)
    return [str(one).replace(f"{file.parent}/", "") for one in caught.value.problems]


def faults(file: Path) -> list[str]:
    """Every problem of a deployment, without file and line."""
    return [one.partition(": ")[2] for one in problems(file)]


class Machine:
    """Deployment file and DBC file in a directory of their own."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.become("forwarder.yaml", "forwarder.dbc")

    def become(self, config: str, dbc: str) -> None:
        """Begin with these shipped files."""
        self.yaml = (ROOT / "config" / config).read_text(encoding="utf-8")
        self.yaml = self.yaml.replace(f"../dbc/{dbc}", "machine.dbc")
        # Tests change tails and cycles, which take a long way to stop.
        self.yaml = re.sub(r"stop_distance_m: [\d.]+", "stop_distance_m: 200", self.yaml)
        self.dbc = (ROOT / "dbc" / dbc).read_text(encoding="cp1252")

    def in_yaml(self, old: str, new: str) -> int:
        """Replace the first ``old`` of the deployment file; return its line."""
        assert old in self.yaml, old
        line = self.yaml[: self.yaml.index(old)].count("\n") + 1
        self.yaml = self.yaml.replace(old, new, 1)
        return line

    def in_dbc(self, old: str, new: str) -> int:
        """Replace the first ``old`` of the DBC file; return its line."""
        assert old in self.dbc, old
        line = self.dbc[: self.dbc.index(old)].count("\n") + 1
        self.dbc = self.dbc.replace(old, new, 1)
        return line

    def write(self) -> Path:
        """Write both files; return the deployment file."""
        path = self.directory / "machine.yaml"
        path.write_text(self.yaml, encoding="utf-8")
        (self.directory / "machine.dbc").write_text(self.dbc, encoding="cp1252")
        return path

    def load(self) -> Deployment:
        return load_deployment(self.write())

    def problems(self) -> list[str]:
        """Every problem, without the directory."""
        return problems(self.write())

    def faults(self) -> list[str]:
        """Every problem, without file and line."""
        return faults(self.write())


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)
