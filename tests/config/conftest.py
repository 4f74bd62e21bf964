"""Deployment files made from the shipped one by changing it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from canshaper.config.load import load_config
from canshaper.config.schema import DeploymentConfig
from canshaper.errors import ConfigError
from tests.rigs.files import ROOT

SHIPPED = ROOT / "config" / "forwarder.yaml"

Load = Callable[[str | bytes], DeploymentConfig]
Problems = Callable[[str | bytes], list[str]]


@pytest.fixture(scope="session")
def shipped() -> str:
    """Text of the shipped deployment."""
    return SHIPPED.read_text(encoding="utf-8")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "machine.yaml"


@pytest.fixture
def load(file: Path) -> Load:
    """Loads a text as a deployment file."""

    def load_text(text: str | bytes) -> DeploymentConfig:
        file.write_bytes(text.encode() if isinstance(text, str) else text)
        return load_config(file)[0]

    return load_text


@pytest.fixture
def problems(load: Load, file: Path) -> Problems:
    """Every problem of a text as lines, the path of the file cut down to its name."""

    def find(text: str | bytes) -> list[str]:
        with pytest.raises(ConfigError) as caught:
            load(text)
        assert str(caught.value).splitlines() == [str(p) for p in caught.value.problems]
        assert all(p.file == str(file) for p in caught.value.problems)
        return [str(p).replace(str(file), file.name) for p in caught.value.problems]

    return find
