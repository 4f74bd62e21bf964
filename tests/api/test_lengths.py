"""A function is read in one go: none is longer than a screen."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MOST = 60
TREES = ("sim", "studies", "tools", "benchmarks", "examples", "tests")
VERBS = ROOT / "canshaper" / "cli" / "verbs"


def lines_of(function: ast.FunctionDef | ast.AsyncFunctionDef, *, verb: bool) -> int:
    """Lines of a function without its docstring; of a verb also without its options."""
    first, last = function.body[0], function.end_lineno
    assert last is not None
    if not ast.get_docstring(function):
        return last - function.lineno + 1
    assert first.end_lineno is not None
    return last - first.end_lineno + (0 if verb else first.lineno - function.lineno)


@pytest.mark.parametrize(
    "tree", ["canshaper", *(pytest.param(tree, marks=pytest.mark.slow) for tree in TREES)]
)
def test_no_function_is_longer_than_a_screen(tree: str) -> None:
    long = []
    for path in sorted((ROOT / tree).rglob("*.py")):
        verb = path.parent == VERBS
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                length = lines_of(node, verb=verb and node.name == path.stem)
                if length > MOST:
                    long.append(f"{path.relative_to(ROOT)}:{node.lineno}: {node.name}: {length}")
    assert long == []


def test_a_long_one_would_be_seen() -> None:
    text = "def f():\n" + "    x = 1\n" * MOST
    function = ast.parse(text).body[0]
    assert isinstance(function, ast.FunctionDef)
    assert lines_of(function, verb=False) == MOST + 1
