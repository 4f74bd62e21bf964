"""Names of mutants: each operator has its own, and a refactoring leaves it as it is."""

import ast
import runpy
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TOOL = runpy.run_path(str(ROOT / "tools/mutant_names.py"))
numbered: Callable[[Sequence[tuple[str, str]]], list[str]] = TOOL["numbered"]
explained: Callable[[Path], dict[str, str]] = TOOL["explained"]


@pytest.mark.parametrize(
    ("before", "after", "name"),
    [
        ("a < b", "a <= b", "comparison < -> <="),
        ("a is b", "a is not b", "comparison is -> is not"),
        ("a not in b", "a in b", "comparison not in -> in"),
        ("a and b and c", "a or b and c", "boolean and -> or"),
        ("a - b", "a + b", "arithmetic - -> +"),
        ('f"{a / 2}"', 'f"{a * 2}"', "arithmetic / -> *"),
        ('f"{a / 2}"', 'f"{a / 3}"', "number 2 -> 3"),
        ("a += b", "a -= b", "assignment += -> -="),
        ("a += b", "a = b", "assignment += -> ="),
        ("a = 0.0", "a = 1.0", "number 0.0 -> 1.0"),
        ("a = 0.0", "a = None", "value 0.0 -> None"),
        ("a = b + c", "a = None", "value -> None"),
        ("a = None", 'a = ""', "value None -> text"),
        ("a = False", "a = True", "boolean False -> True"),
        ("a = not b", "a = b", "not left out"),
        ('a = "on"', 'a = "XXonXX"', "text -> XXtextXX"),
        ('a = "on"', 'a = "ON"', "text -> upper case"),
        ("min(a, b)", "max(a, b)", "word min -> max"),
        ("f(a, b)", "f(a, None)", "argument 2 -> None"),
        ("f(a, b)", "f(a, )", "argument 2 left out"),
        ("f(a, key=b)", "f(a, key=None)", "argument key -> None"),
        ("f(a, key=b)", "f(a, )", "argument key left out"),
        ("f(a, **b)", "f(a, )", "argument ** left out"),
        ("f(a)", "pass", "call left out"),
        ("raise E(a)", "pass", "raise left out"),
        ("return", "pass", "return left out"),
        ("a = lambda: b", "a = lambda: None", "lambda -> None"),
        ("if a or b: c", "if not (a or b): c", "condition negated"),
        ("if not a: c", "if not (not a): c", "condition negated"),
        ("a = b if c and d else e", "a = b if (c and d) and False else e", "condition and False"),
        ("a = b if c else d", "a = b if (c) or True else d", "condition or True"),
    ],
)
def test_a_mutant_is_called_by_its_operator(before: str, after: str, name: str) -> None:
    """One change, one name."""
    function = "def f():\n    {}\n".format
    assert numbered([(function(before), function(after))]) == [f"{name} #1"]


def test_a_case_of_a_match_is_counted() -> None:
    """The second of two."""
    before = "match a:\n    case 1: b\n    case 2: c\n"
    assert numbered([(before, "match a:\n    case 1: b\n")]) == ["case 2 left out #1"]


def test_places_of_one_operator_are_counted_in_the_order_of_the_source() -> None:
    """Whatever order the mutants come in."""
    before = "a < b\nc < d\n"
    changes = [(before, "a < b\nc <= d\n"), (before, "a <= b\nc < d\n")]
    assert numbered(changes) == ["comparison < -> <= #2", "comparison < -> <= #1"]


def test_names_comments_and_layout_leave_a_name_as_it_is() -> None:
    """A refactoring that keeps the operators keeps the list of survivors."""
    one = ("if self._bump > low:\n    go(low)\n", "if self._bump >= low:\n    go(low)\n")
    other = (
        "if (\n    self.offset > least  # at rest\n):\n    drive(least)\n",
        "if (\n    self.offset >= least  # at rest\n):\n    drive(least)\n",
    )
    assert numbered([one]) == numbered([other]) == ["comparison > -> >= #1"]


def test_every_survivor_is_of_a_module_that_is_there_and_has_a_reason() -> None:
    for name in explained(ROOT / "tests/mutation/survivors.txt"):
        parts = name.partition(":")[0].split(".")
        assert any(ROOT.joinpath(*parts[:n]).with_suffix(".py").exists() for n in (3, 4, 5)), name


@pytest.mark.parametrize("text", ["    a reason of nothing\n", "a.b: call left out #1\n"])
def test_a_name_without_a_reason_is_no_entry_nor_is_a_reason_without_a_name(
    tmp_path: Path, text: str
) -> None:
    file = tmp_path / "survivors.txt"
    file.write_text(f"# Mutants.\n\n{text}", encoding="utf-8")
    with pytest.raises(SystemExit, match="no name or no reason"):
        explained(file)


def functions() -> set[str]:
    """Every function of the program by its full name."""
    names = set()
    for path in (ROOT / "canshaper").rglob("*.py"):
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        waiting: list[tuple[str, ast.AST]] = [(module, ast.parse(path.read_text(encoding="utf-8")))]
        while waiting:
            name, node = waiting.pop()
            for one in ast.iter_child_nodes(node):
                if isinstance(one, ast.ClassDef | ast.FunctionDef):
                    waiting.append((f"{name}.{one.name}", one))
            if isinstance(node, ast.FunctionDef):
                names.add(name)
    return names


def test_each_survivor_is_of_a_function_that_is_there() -> None:
    reasons = explained(ROOT / "tests/mutation/survivors.txt")
    assert len(reasons) > 100
    assert {name.partition(":")[0] for name in reasons} - functions() == set()
