"""Deployment and DBC files of any content load, or say why not; what loads, runs."""

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st

from canshaper.can.binding import Deployment
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


@many
@given(name=names, change=changes(YAML_WORDS))
def test_any_change_of_a_deployment_file(
    load: Load, name: str, change: list[tuple[int, int, str]]
) -> None:
    yaml, dbc = TEXTS[name]
    event("loaded" if load(changed(yaml, change), dbc) else "refused")


@many
@given(name=names, change=changes(DBC_WORDS))
def test_any_change_of_a_dbc_file(
    load: Load, name: str, change: list[tuple[int, int, str]]
) -> None:
    yaml, dbc = TEXTS[name]
    event("loaded" if load(yaml, changed(dbc, change)) else "refused")


@many
@given(text=st.text(max_size=200) | st.text(alphabet='BO_SGVAL:|@+-()[]"; \n019ab', max_size=200))
def test_any_text_as_a_dbc_file(load: Load, text: str) -> None:
    load(TEXTS["forwarder"][0], text)


@many
@given(text=st.text(max_size=200))
def test_any_text_as_a_deployment_file(load: Load, text: str) -> None:
    load(text, TEXTS["forwarder"][1])
