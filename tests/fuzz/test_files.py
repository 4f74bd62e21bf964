"""Deployment and DBC files of any content load, or say why not; what loads, runs."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, event, example, given, settings
from hypothesis import strategies as st

from canshaper.machine.deployment import Deployment
from tests.fuzz.files import SHIPPED, SMALL, Files, texts
from tests.fuzz.mutate import DBC_WORDS, YAML_WORDS, changed

TEXTS = {name: texts(name) for name in (SMALL, *SHIPPED)}
names = st.sampled_from(list(TEXTS))
Load = Callable[[str, str], Deployment | None]

many = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=150)


@pytest.fixture
def load(tmp_path: Path) -> Load:
    files = Files(tmp_path)

    def load_texts(yaml: str, dbc: str) -> Deployment | None:
        return files.load(
            yaml.encode("utf-8", errors="surrogatepass"), dbc.encode("cp1252", errors="replace")
        )

    return load_texts


def changes(words: tuple[str, ...]) -> st.SearchStrategy[list[tuple[int, int, str]]]:
    where, how = st.integers(0, 10_000), st.integers(0, 600)
    return st.lists(st.tuples(where, how, st.sampled_from(words)), min_size=1, max_size=4)


@pytest.mark.parametrize("name", TEXTS)
def test_files_as_they_are_load_and_run(load: Load, name: str) -> None:
    assert load(*TEXTS[name])


# What a process may take that loads a file: far more than any, far less than a machine has.
MOST_MEMORY, MOST_SECONDS = 1 << 30, 30
LOAD = """
import resource, sys
from pathlib import Path
resource.setrlimit(resource.RLIMIT_AS, ({0}, {0}))
resource.setrlimit(resource.RLIMIT_CPU, ({1}, {1}))
from canshaper.machine.binding import load_deployment
from canshaper.errors import ConfigError
try:
    load_deployment(Path(sys.argv[1]))
except ConfigError as error:
    print(error)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("BO_ 784 Service: 8 ", "BO_ 784 Service: 2147483920 "),
        ("SG_ Spare : 8|8@1+", "SG_ Spare : 8|99999999999@1+"),
        ("SG_ Spare : 8|8@1+", "SG_ Spare : 99999999999|8@1+"),
        ("SG_ Spare : 8|8@1+", "SG_ Spare : 99999999999|8@0+"),
    ],
)
def test_a_length_with_digits_too_many_is_refused(tmp_path: Path, old: str, new: str) -> None:
    """Without taking all memory of the machine."""
    yaml, dbc = TEXTS[SMALL]
    assert old in dbc
    (tmp_path / "machine.yaml").write_text(yaml)
    (tmp_path / "machine.dbc").write_text(dbc.replace(old, new, 1))
    load = LOAD.format(MOST_MEMORY, MOST_SECONDS)
    done = subprocess.run(
        [sys.executable, "-c", load, str(tmp_path / "machine.yaml")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    line = dbc[: dbc.index(old)].count("\n") + 1
    assert f"machine.dbc:{line}: " in done.stdout


@pytest.mark.slow
@many
@given(name=names, change=changes(YAML_WORDS))
def test_any_change_of_a_deployment_file(
    load: Load, name: str, change: list[tuple[int, int, str]]
) -> None:
    yaml, dbc = TEXTS[name]
    event("loaded" if load(changed(yaml, change), dbc) else "refused")


@pytest.mark.slow
@many
@given(name=names, change=changes(DBC_WORDS))
@example(name="forwarder", change=[(485, 0, "-0")])  # an id that only the parser reads
def test_any_change_of_a_dbc_file(
    load: Load, name: str, change: list[tuple[int, int, str]]
) -> None:
    yaml, dbc = TEXTS[name]
    event("loaded" if load(yaml, changed(dbc, change)) else "refused")


@pytest.mark.slow
@many
@given(text=st.text(max_size=200) | st.text(alphabet='BO_SGVAL:|@+-()[]"; \n019ab', max_size=200))
def test_any_text_as_a_dbc_file(load: Load, text: str) -> None:
    load(TEXTS["forwarder"][0], text)


@many
@given(text=st.text(max_size=200))
def test_any_text_as_a_deployment_file(load: Load, text: str) -> None:
    load(text, TEXTS["forwarder"][1])
