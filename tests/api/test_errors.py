"""The tree of errors is all there is of them, and is drawn as it is."""

import importlib
import inspect
import pkgutil
import re
from types import ModuleType

import canshaper
from canshaper import errors


def drawn() -> dict[str, str]:
    """Each class of the picture with that above it."""
    above: list[tuple[int, str]] = []
    parents = {}
    for line in errors.__doc__.splitlines():  # type: ignore[union-attr]
        match = re.match(r" {4}([ |]*)(\+-- )?(\w+Error)\b", line)
        if not match:
            continue
        depth = len(match[1])
        above = [(d, name) for d, name in above if d < depth]
        parents[match[3]] = above[-1][1] if above else "Exception"
        above.append((depth, match[3]))
    return parents


def in_tree(module: ModuleType) -> dict[str, type]:
    return {
        name: value
        for name, value in vars(module).items()
        if inspect.isclass(value) and issubclass(value, Exception)
    }


def test_the_picture_is_the_tree() -> None:
    assert drawn() == {n: c.__bases__[0].__name__ for n, c in in_tree(errors).items()}


def test_no_error_stands_anywhere_else() -> None:
    for info in pkgutil.walk_packages(canshaper.__path__, "canshaper."):
        if info.name.endswith("__main__"):
            continue
        try:
            module = importlib.import_module(info.name)
        except ModuleNotFoundError as error:
            assert error.name == "asammdf"  # in no environment of the quick tests
            continue
        for name, error in in_tree(module).items():
            if error.__module__.startswith("canshaper") and not name.startswith("_"):
                assert error.__module__ == "canshaper.errors", error
