"""Which mutants the type checker refuses: `make lint` too is a test that a change has to pass.

One run of mypy sees all of them, as mutmut writes each as a function of its own.
"""

import ast
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

# What no way of writing all mutants into one file can bring about; other errors may come from that.
REFUSALS = frozenset(
    (
        *("arg-type", "assignment", "attr-defined", "call-arg", "call-overload", "dict-item"),
        *("index", "list-item", "operator", "return-value", "str-unpack", "type-var"),
        *("typeddict-item", "typeddict-unknown-key", "union-attr"),
    )
)


def refused(sources: list[Path]) -> set[str]:
    """Return mutmut's names of the mutants in these files with an error of REFUSALS by mypy.

    Raises:
        RuntimeError: mypy failed, or such an error is in no mutant.
    """
    command = [sys.executable, "-m", "mypy", "--output=json", *map(str, sources)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError(done.stdout + done.stderr)
    wrong: dict[str, list[dict[str, str | int]]] = {}
    for line in done.stdout.splitlines():
        error = json.loads(line)
        if error["code"] in REFUSALS:
            wrong.setdefault(error["file"], []).append(error)
    names = set()
    for source in sources:
        functions = list(mutants(source))
        for error in wrong.get(str(source), ()):
            inside = [name for name, lines in functions if error["line"] in lines]
            if not inside:
                raise RuntimeError(f"{source}:{error['line']}: {error['message']}")
            names.add(f"{'.'.join(source.with_suffix('').parts)}.{inside[0]}")
    return names


def mutants(source: Path) -> Iterator[tuple[str, range]]:
    """Yield the function name and the lines of each mutant in a file that mutmut wrote."""
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef) and re.search(r"__mutmut_\d+$", node.name):
            assert node.end_lineno is not None
            yield node.name, range(node.lineno, node.end_lineno + 1)
