"""Mutation run: change the code in small ways, one at a time, and see whether a test notices.

    tools/mutation.py                     every module of the coverage gate, group by group
    tools/mutation.py core                what runs in `make test`: state machine and output limits,
                                          without the survivors that are explained
    tools/mutation.py shaping PATTERN     mutants by name, such as '*fir*zv_taps*'
    tools/mutation.py -j1 daemon          so many at a time, here one; two without it

Each mutant gets the type checker and, where that has nothing against it, the quick tests that reach
its function. Survivors have to stand, with a reason, in tests/mutation/survivors.txt; the run fails
for one that does not, and for an entry that fits no mutant any more. Works on copies in
out/mutation.
"""

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
SURVIVORS = ROOT / "tests/mutation/survivors.txt"
DAEMON = [f"tests/{room}" for room in ("inputs", "guard", "protocols", "controller", "daemon")]
# The groups: rooms, each with the tests that reach it.
TESTS = {
    "checksums": ["tests/codec"],
    "codec": ["tests/codec"],
    "machine": ["tests/machine", "tests/codec"],
    "shaping": ["tests/shaping"],
    "inputs": DAEMON,
    "guard": DAEMON,
    "protocols": [*DAEMON, "tests/machine/test_gateway_binding.py"],
    "controller": DAEMON,
    "daemon": DAEMON,
    "bus": ["tests/bus"],
}
CORE = [f"canshaper.shaping.{name}" for name in ("axis", "limits", "state_machine", "transfer")]
CORE_TESTS = [
    "test_added*.py",
    "test_axis*.py",
    "test_limits.py",
    "test_motion*.py",
    "test_other_plane.py",
    "test_sensed.py",
    "test_sets.py",
    "test_small_strokes.py",
    "test_state_machine.py",
    "test_valve_curve.py",
]
COPIED = ["canshaper", "sim", "dbc", "config", "docs", "tools"]
GATE = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["coverage"]["run"]


def modules(group: str) -> list[str]:
    """Modules of the coverage gate in a room."""
    return [name for name in GATE["source_pkgs"] if name.split(".")[1] == group]


def prepare(work: Path, mutated: list[str], tests: list[str]) -> None:
    """Copy what the tests need and say there what mutmut shall do."""
    shutil.rmtree(work, ignore_errors=True)
    for name in (*COPIED, "tests"):
        ignore = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, work / name, ignore=ignore)
    paths = [name.replace(".", "/") for name in mutated]
    only = [f"{path}/*" if (ROOT / path).is_dir() else f"{path}.py" for path in paths]
    (work / "pyproject.toml").write_text(
        (ROOT / "pyproject.toml").read_text()
        + f"""
[tool.mutmut]
source_paths = ["canshaper"]
only_mutate = {only}
do_not_mutate = {GATE["omit"]}
also_copy = {COPIED[1:]}
pytest_add_cli_args_test_selection = {tests}
pytest_add_cli_args = [
    "-m", "not long and not processes", "--hypothesis-profile=mutants", "-p", "no:cacheprovider",
    "-p", "no:unraisableexception",  # collects garbage at the end of every run
]
timeout_multiplier = 2.0
use_git_change_detection = false
"""
    )


def run(group: str, patterns: list[str], processes: str) -> int:
    """Prepare, run and judge one group."""
    work = ROOT / "out/mutation" / group
    start = time.monotonic()
    if group == "core":
        paths = [path for name in CORE_TESTS for path in (ROOT / "tests/shaping").glob(name)]
        prepare(work, CORE, sorted(str(path.relative_to(ROOT)) for path in paths))
    else:
        prepare(work, modules(group), TESTS[group])
    mutants = [sys.executable, str(ROOT / "tools/mutants.py")]
    log = work / "mutmut.log"
    # Folders of its own: another run of pytest would remove them as garbage.
    with log.open("w") as out, tempfile.TemporaryDirectory() as temporary:
        how = ["run-new", str(SURVIVORS)] if group == "core" else ["run"]
        command = [*mutants, *how, processes, *patterns]
        env = {**os.environ, "PYTEST_DEBUG_TEMPROOT": temporary}
        ran = subprocess.run(command, cwd=work, env=env, stdout=out, stderr=out, check=False)
    if ran.returncode:
        print(log.read_text()[-5000:])
        return ran.returncode
    command = [*mutants, "judge", str(SURVIVORS), *patterns]
    code = subprocess.run(command, cwd=work, check=False).returncode
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(
        f"{group}: {time.monotonic() - start:.0f} s,"
        f" {used.ru_utime + used.ru_stime:.0f} s of processor time"
    )
    return code


if __name__ == "__main__":
    arguments = sys.argv[1:]
    at_a_time = arguments.pop(0)[2:] if arguments[:1] and arguments[0].startswith("-j") else "2"
    groups, chosen = arguments[:1] or list(TESTS), arguments[1:]
    if not set(groups) <= {*TESTS, "core"} or not at_a_time.isdecimal():
        sys.exit(__doc__)
    sys.exit(max([run(group, chosen, at_a_time) for group in groups]))
