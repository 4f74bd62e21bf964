"""Mutants by mutmut and more operators, and what their tests say; for tools/mutation.py.

    mutants.py run PROCESSES [PATTERN ...]         all that mypy does not refuse
    mutants.py run-new SURVIVORS PROCESSES [PATTERN ...]
                                                   the same, without the explained ones
    mutants.py judge SURVIVORS [PATTERN ...]

In the working directory, where mutmut finds its settings as soon as it is imported.
"""

import fnmatch
import re
import signal
import sys
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator
from difflib import unified_diff
from pathlib import Path
from typing import NamedTuple

import libcst as cst
from mutant_names import explained, numbered
from mutant_run import FAILED, UNREACHED, Forks
from mutant_types import refused
from mutmut import __main__ as mutmut
from mutmut.configuration import config
from mutmut.mutation.data import SourceFileMutationData
from mutmut.mutation.diff_apply import read_functions_from_index
from mutmut.mutation.mutators import mutation_operators
from mutmut.mutation.trampoline import set_mutant_under_test
from mutmut.runners.harness import PytestRunner
from mutmut.utils.file_utils import change_cwd, walk_mutatable_files
from mutmut.workers.isolation import ForkRunner

# Exit codes: no test failed; the type checker refuses it; an explained one, left to a run of all.
SURVIVED, TYPES, EXPLAINED = 0, 37, 38
KILLED = {
    FAILED: "killed",
    TYPES: "refused by the type checker",
    # a loop that never ends, or a wait
    -signal.SIGPROF: "killed by the time limit",
    -signal.SIGALRM: "killed by the time limit",
}


class Mutant(NamedTuple):
    """One change: mutmut's record and key of it, our name, the function without and with it."""

    data: SourceFileMutationData
    key: str
    name: str  # function: operator #number
    before: str
    after: str

    def save(self, exit_code: int) -> None:
        """Write the exit code of its tests into mutmut's file."""
        self.data.exit_code_by_key[self.key] = exit_code
        self.data.save()

    def difference(self) -> str:
        """Return the lines that changed, as a diff without context."""
        lines = unified_diff(self.before.splitlines(), self.after.splitlines(), n=0)
        return "\n".join(line.rstrip() for line in list(lines)[3:])


# -- more operators than mutmut has ----------------------------------------------------------------


def negated(node: cst.If) -> Iterator[cst.If]:
    """Yield an ``if`` with its condition negated."""
    test = node.test.with_changes(lpar=[cst.LeftParen()], rpar=[cst.RightParen()])
    yield node.with_changes(test=cst.UnaryOperation(cst.Not(), test))


def swapped(node: cst.Call) -> Iterator[cst.Call]:
    """Yield ``max`` for a call of ``min`` and ``min`` for ``max``; nothing for another call."""
    other = {"min": "max", "max": "min"}
    if isinstance(node.func, cst.Name) and node.func.value in other:
        yield node.with_changes(func=cst.Name(other[node.func.value]))


def left_out(node: cst.Expr | cst.Raise | cst.Return) -> Iterator[cst.Pass]:
    """Yield ``pass`` for a call on its own, a raise, or a return of nothing; else nothing."""
    call = isinstance(node, cst.Expr) and isinstance(node.value, cst.Call)
    way_out = isinstance(node, cst.Return) and node.value is None
    if call or way_out or isinstance(node, cst.Raise):
        yield cst.Pass()


MORE = (
    (cst.If, negated),
    (cst.Call, swapped),
    *((kind, left_out) for kind in (cst.Expr, cst.Raise, cst.Return)),
)

# -- the run, in the working directory -------------------------------------------------------------


def run(processes: int, patterns: list[str], known: Collection[str] | None = None) -> int:
    """Make the mutants in ./mutants, which must not exist, and run the tests of each.

    Args:
        processes: how many at a time.
        patterns: names of mutants; none for all.
        known: survivors that are not run again, as each needs every test; None to run all.

    Returns:
        Exit code of pytest.
    """
    mutation_operators.extend(MORE)  # type: ignore[attr-defined]
    Path("mutants").mkdir()
    set_mutant_under_test("mutant_generation")
    mutmut.copy_src_dir()
    mutmut.copy_also_copy_files()
    mutmut.setup_source_paths()
    mutmut.create_mutants(processes)
    with change_cwd("mutants"):
        of_types = refused(list(walk_mutatable_files()))
    chosen = []
    for mutant in mutants():
        if mutant.key in of_types:
            mutant.save(TYPES)
        elif known is not None and mutant.name in known:
            mutant.save(EXPLAINED)
        elif any(fnmatch.fnmatch(mutant.key, pattern) for pattern in patterns or ["*"]):
            chosen.append(mutant)
    runner = PytestRunner()
    mutmut.collect_or_load_stats(ForkRunner(processes, runner))  # which test reaches what
    set_mutant_under_test("")
    forks = Forks([mutant.key for mutant in chosen], processes)
    with change_cwd("mutants"):
        every_test = config().pytest_add_cli_args_test_selection
        code = runner.execute_pytest(["-q", *every_test], plugins=[forks])
    for mutant in chosen:
        mutant.save(forks.exit_codes[mutant.key])
    return code


def mutants() -> Iterator[Mutant]:
    """Yield every mutant that mutmut has written in the working directory."""
    for path in walk_mutatable_files():
        data = SourceFileMutationData(path=path)
        data.load()
        of_function: defaultdict[str, list[str]] = defaultdict(list)
        for key in data.exit_code_by_key:
            of_function[function_of(key)].append(key)
        for function, keys in of_function.items():
            sources = [source_of(key, path) for key in keys]
            for key, name, source in zip(keys, numbered(sources), sources, strict=True):
                yield Mutant(data, key, f"{function}: {name}", *source)


def source_of(key: str, path: Path) -> tuple[str, str]:
    """Return the source of a mutant's function, before and after the change."""
    functions = read_functions_from_index(key, path)
    assert functions, f"mutmut has no lines of {key}"
    before, after = (cst.Module([function]).code.strip() + "\n" for function in functions)
    return before, after


def function_of(mutant: str) -> str:
    """Name a mutant's function as Python does: axis.xǁAxisǁact__mutmut_3 gives axis.Axis.act."""
    name = re.sub(r"__mutmut_\d+$", "", mutant)
    return re.sub(r"xǁ(\w+)ǁ", r"\1.", name).replace(".x_", ".")


def judge(known: dict[str, str], patterns: list[str]) -> int:
    """Print the result; return 0 if every survivor has a reason, and every reason its survivor.

    A mutant that no test reaches, or none at all, gives 1. With patterns only mutants that they
    name count, and a reason without a mutant is not looked for.
    """
    counts: Counter[str] = Counter()
    seen: set[str] = set()
    failures = 0
    for mutant in mutants():
        if patterns and not any(fnmatch.fnmatch(mutant.key, pattern) for pattern in patterns):
            continue
        code = mutant.data.exit_code_by_key[mutant.key]
        seen.add(mutant.name)
        if code in KILLED:
            counts[KILLED[code]] += 1
            if mutant.name in known:
                failures += 1
                print(f"\n# killed, though explained\n{mutant.name}\n{mutant.difference()}")
        elif code == EXPLAINED:
            counts["explained, not run again"] += 1
        elif code == SURVIVED and mutant.name in known:
            counts["survived for a reason"] += 1
        else:
            failures += 1
            words = {SURVIVED: "survived", UNREACHED: "reached by no test"}
            what = words.get(code, f"came to nothing ({code})")
            counts[what] += 1
            print(f"\n# {what}: {mutant.key}\n{mutant.name}\n{mutant.difference()}")
    mutated = {name.partition(":")[0].rpartition(".")[0] for name in seen}
    for name in known:
        of = name.partition(":")[0].rpartition(".")[0]
        if not patterns and of in mutated and name not in seen:
            failures += 1
            print(f"\n# explained, but no such mutant\n{name}")
    print(f"\n{counts.total()} mutants:", ", ".join(f"{n} {what}" for what, n in counts.items()))
    return 1 if failures or not counts else 0


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["run", processes, *patterns]:
            sys.exit(run(int(processes), patterns))
        case ["run-new", survivors, processes, *patterns]:
            sys.exit(run(int(processes), patterns, explained(Path(survivors))))
        case ["judge", survivors, *patterns]:
            sys.exit(judge(explained(Path(survivors)), patterns))
