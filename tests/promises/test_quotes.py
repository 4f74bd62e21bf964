"""Each class quotes its promise, as the page has it."""

import importlib
import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs/safety.md"


def promise(number: int) -> str:
    """The sentences of the page, without links and names of tests."""
    page = PAGE.read_text(encoding="utf-8").partition("## Promises")[2].partition("\n## ")[0]
    text = " ".join(re.split(r"^- P\d ", page, flags=re.MULTILINE)[number].split())
    text = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", text)
    return re.sub(r" `\w+/test_\w+`", "", text)


@pytest.mark.parametrize("number", range(1, 7))
def test_the_docstring_is_the_promise(number: int) -> None:
    module = importlib.import_module(f"tests.promises.test_{number}")
    (one,) = (value for name, value in vars(module).items() if name.startswith("Test"))
    assert " ".join(one.__doc__.split()) == promise(number)
