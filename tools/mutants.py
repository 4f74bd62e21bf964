"""mutmut with more operators, and what its result says; for tools/mutation.py.

mutants.py run SURVIVORS|- [PATTERN ...]     in the working directory, where mutmut finds its
mutants.py judge SURVIVORS [PATTERN ...]     settings as soon as it is imported
"""

import fnmatch
import re
import signal
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import libcst as cst
from mutmut import __main__ as mutmut
from mutmut.mutation.data import SourceFileMutationData
from mutmut.mutation.diff_apply import get_diff_for_mutant
from mutmut.mutation.mutators import mutation_operators
from mutmut.runners.harness import PytestRunner
from mutmut.state import state
from mutmut.utils.file_utils import change_cwd, walk_mutatable_files
from mutmut.workers import isolation

PROCESSES = 2
# Exit codes of mutmut's workers: a test failed, or its time was up (a loop that never ends).
KILLED, TIMED_OUT, SURVIVED, TYPES = (1, 3), (-27, -24, 24, 36, 152, 255), 0, 37
UNREACHED = 33  # none of the chosen tests calls the function

Change = tuple[str, tuple[str, ...]]  # function, and the lines of the difference


# -- more operators than mutmut has ----------------------------------------------------------------


def negated(node: cst.If) -> Iterator[cst.If]:
    """Turn a condition round."""
    test = node.test.with_changes(lpar=[cst.LeftParen()], rpar=[cst.RightParen()])
    yield node.with_changes(test=cst.UnaryOperation(cst.Not(), test))


def swapped(node: cst.Call) -> Iterator[cst.Call]:
    """Take the smaller of two where the larger was meant."""
    other = {"min": "max", "max": "min"}
    if isinstance(node.func, cst.Name) and node.func.value in other:
        yield node.with_changes(func=cst.Name(other[node.func.value]))


def left_out(node: cst.Expr | cst.Raise | cst.Return) -> Iterator[cst.Pass]:
    """Leave out a call, a refusal, or a way out."""
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


def patient(pid: int, timeout_s: float) -> None:
    """Leave the limit to processor time: on a busy machine the clock would kill what survives."""
    register_timeout(pid, 30.0 * timeout_s)


register_timeout = isolation.register_timeout


class Limit:
    """Ends a worker in one of whose tests a loop never ends, by processor time."""

    def pytest_runtest_logstart(self, nodeid: str, location: Any) -> None:
        """Four times what the test takes without a mutant, and two seconds more."""
        signal.setitimer(signal.ITIMER_PROF, 2.0 + 4.0 * state().duration_by_test[nodeid])


def run_tests(runner: PytestRunner, *, mutant_name: str | None, tests: Iterable[str]) -> int:
    """Run tests as mutmut does, each of those of a mutant with a limit."""
    plugins = [Limit()] if mutant_name else []
    with change_cwd("mutants"):
        return int(runner.execute_pytest(runner._pytest_args_regular_run(tests), plugins=plugins))


def run(patterns: list[str], survivors: dict[Change, str] | None = None) -> None:
    """Run mutmut.

    Args:
        patterns: names of mutants; none for all.
        survivors: where time is short, what is known to survive; it is not run again, and neither
            is what puts None into the code, which the type checker refuses.
    """
    mutation_operators.extend(MORE)  # type: ignore[attr-defined]
    isolation.register_timeout = patient
    PytestRunner.run_tests = run_tests  # type: ignore[method-assign]
    if survivors is not None:
        Path("mutants").mkdir()
        mutmut.copy_src_dir()
        mutmut.create_mutants(PROCESSES)
        for data, name, change in mutants():
            nones = Counter(line[0] for line in change[1] for _ in re.findall(r"\bNone\b", line))
            if change in survivors or nones["+"] > nones["-"]:
                data.exit_code_by_key[name] = SURVIVED if change in survivors else TYPES
                data.save()
    mutmut._run(patterns, PROCESSES)


def mutants() -> Iterator[tuple[SourceFileMutationData, str, Change]]:
    """Every mutant: where its exit code is, its name, and what it changed."""
    for path in walk_mutatable_files():
        data = SourceFileMutationData(path=path)
        data.load()
        for name in data.exit_code_by_key:
            lines = get_diff_for_mutant(name, path=path).splitlines()[2:]
            changed = tuple(line.rstrip() for line in lines if line[:1] in "+-")
            yield data, name, (function_of(name), changed)


def function_of(mutant: str) -> str:
    """Name a function as Python does: canshaper.shaping.axis.xǁAxisǁ_go__mutmut_3 is Axis._go."""
    name = re.sub(r"__mutmut_\d+$", "", mutant)
    return re.sub(r"xǁ(\w+)ǁ", r"\1.", name).replace(".x_", ".")


def explained(survivors: Path) -> dict[Change, str]:
    """Survivors with their reasons: `function`, lines of the difference, `= reason`, blank line."""
    entries: dict[Change, str] = {}
    for block in survivors.read_text().split("\n\n"):
        lines = [line.rstrip() for line in block.splitlines() if not line.startswith("#")]
        if lines:
            changed = tuple(line for line in lines[1:] if line[0] in "+-")
            reason = " ".join(line[1:].strip() for line in lines[1:] if line[0] == "=")
            if not (changed and reason):
                raise SystemExit(f"{survivors.name}: no difference or no reason:\n{block}")
            entries[lines[0], changed] = reason
    return entries


def judge(known: dict[Change, str], patterns: list[str]) -> int:
    """Print the result; 0 when every survivor has its reason, and every reason its survivor."""
    counts: Counter[str] = Counter()
    seen: set[Change] = set()
    alive: set[Change] = set()
    failures = 0
    for data, name, change in mutants():
        if patterns and not any(fnmatch.fnmatch(name, pattern) for pattern in patterns):
            continue
        code = data.exit_code_by_key[name]
        seen.add(change)
        if code in (*KILLED, *TIMED_OUT):
            counts["killed" if code in KILLED else "killed by the time limit"] += 1
        elif code == TYPES:
            counts["left to the type checker"] += 1
        elif code == SURVIVED and change in known:
            counts["survived for a reason"] += 1
            alive.add(change)
        else:
            failures += 1
            words = {SURVIVED: "survived", UNREACHED: "reached by no test"}
            what = words.get(code, f"came to nothing ({code})")
            counts[what] += 1
            print(f"\n# {what}: {name}", change[0], *change[1], sep="\n")
    for change in (known.keys() & seen) - alive:  # a function may have the same line twice
        print("\n# killed, though explained", change[0], *change[1], sep="\n")
    mutated = {function.rpartition(".")[0] for function, _ in seen}
    for function, changed in known:
        module = function.rpartition(".")[0]
        if not patterns and module in mutated and (function, changed) not in seen:
            failures += 1
            print("\n# explained, but no such mutant", function, *changed, sep="\n")
    print(f"\n{counts.total()} mutants:", ", ".join(f"{n} {what}" for what, n in counts.items()))
    return 1 if failures or not counts else 0


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["run", "-", *patterns]:
            run(patterns)
        case ["run", survivors, *patterns]:
            run(patterns, explained(Path(survivors)))
        case ["judge", survivors, *patterns]:
            sys.exit(judge(explained(Path(survivors)), patterns))
