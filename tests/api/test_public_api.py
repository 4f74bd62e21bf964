"""The interface for other programs: complete, documented, lazy, and every example of it runs."""

import ast
import doctest
import importlib
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import canshaper

ROOT = Path(__file__).parents[2]
# Modules whose docstrings have examples.
DOCTESTS = ("__init__", "api", "checksums.kinds", "shaping.registry", "shaping.shapers.kind")


def type_checked() -> set[str]:
    """Names that a type checker sees in the package."""
    tree = ast.parse(Path(str(canshaper.__file__)).read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    return {
        name.name for node in block.body if isinstance(node, ast.ImportFrom) for name in node.names
    }


def test_every_name_is_there_for_programs_and_for_type_checkers() -> None:
    assert canshaper.__all__ == sorted(canshaper.__all__, key=lambda n: (n.islower(), n))
    assert {*canshaper.__all__} == type_checked()
    assert {*dir(canshaper)} == {*canshaper.__all__, "__version__"}
    for name in canshaper.__all__:
        assert getattr(canshaper, name) is not None
    with pytest.raises(AttributeError, match="'nonsense'"):
        _ = canshaper.nonsense


def public() -> list[tuple[str, object]]:
    """Each public class and function, and each public method of the classes of the API."""
    found: list[tuple[str, object]] = []
    for name in canshaper.__all__:
        value = getattr(canshaper, name)
        found.append((name, value))
        if getattr(value, "__module__", "") == "canshaper.api":
            methods = [(n, f) for n, f in vars(value).items() if inspect.isfunction(f)]
            found += [(f"{name}.{n}", f) for n, f in methods if not n.startswith("_")]
    return found


@pytest.mark.parametrize(("name", "value"), [pytest.param(*pair, id=pair[0]) for pair in public()])
def test_docstrings_say_what_goes_in_and_out(name: str, value: object) -> None:
    text = inspect.getdoc(value)
    assert text, name
    if not inspect.isfunction(value):
        return
    signature = inspect.signature(value)
    arguments = [p for p in signature.parameters if p != "self"]
    if len(arguments) > 1 or name in ("load_machine", "build_shaper"):
        assert "Args:" in text
        assert all(
            f"    {argument}: " in text for argument in arguments if argument != "parameters"
        )
        assert "Returns:" in text
    if "." not in name:
        assert "Raises:" in text
        assert ">>> " in text


@pytest.mark.parametrize("name", ["Controller", "load_machine", "build_shaper", "ShaperKind"])
def test_what_is_called_first_has_an_example(name: str) -> None:
    assert ">>> " in str(inspect.getdoc(getattr(canshaper, name)))


@pytest.mark.parametrize("module", DOCTESTS)
def test_examples_in_docstrings_run(module: str) -> None:
    name = "canshaper" if module == "__init__" else f"canshaper.{module}"
    result = doctest.testmod(importlib.import_module(name))
    assert (result.failed, result.attempted > 0) == (0, True)


def test_nothing_is_imported_before_it_is_used() -> None:
    code = (
        "import sys, canshaper\n"
        "print(*(m for m in sys.modules if m.startswith('canshaper.')))\n"
        "canshaper.Frame\n"
        "print(*(m for m in sys.modules if m.split('.')[0] in ('can', 'cantools', 'pydantic')))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "\n\n"


SAYS = {
    "controller_without_io.py": " 0.52 s axis=slew state=ACTIVE from=READY reason=JOYSTICK_MOVED",
    "plant_on_bus.py": "0x402 {'",
}


@pytest.mark.slow
@pytest.mark.parametrize("example", sorted(SAYS))
def test_examples_run(example: str, tmp_path: Path) -> None:
    path = ROOT / "examples" / example
    done = subprocess.run(
        [sys.executable, str(path)], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert SAYS[example] in done.stdout


def test_every_example_is_short_and_is_run_by_a_test() -> None:
    """The two packages are installed and run in tests/config and tests/controller."""
    files = {path.relative_to(ROOT / "examples") for path in (ROOT / "examples").rglob("*.py")}
    packages = {Path("own_filter/moving_average.py"), Path("own_checksum/acme_checksum.py")}
    assert files == {Path(name) for name in SAYS} | packages
    for file in files:
        assert 10 <= len((ROOT / "examples" / file).read_text().splitlines()) <= 40, file


def test_the_page_of_the_api_names_all_of_it_and_its_program_runs(
    capsys: pytest.CaptureFixture[str],
) -> None:
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    named = {*re.findall(r"`(\w+)`", page)}
    kinds = {name for name in canshaper.__all__ if name != "Event" and name.endswith("Event")}
    assert {*canshaper.__all__} - kinds <= named
    (program,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    exec(program, {})
    assert f"`{capsys.readouterr().out.strip()}`" in page
