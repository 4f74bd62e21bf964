"""Mutation run: change the code in small ways, one at a time, and see whether a test notices.

    tools/mutation.py                     every module of the coverage gate, group by group
    tools/mutation.py core                part of `make test-all`: state machine and output
                                          limits, without the survivors that are explained
    tools/mutation.py shaping PATTERN     mutants by name, such as '*fir*zv_taps*'
    tools/mutation.py -j1 daemon          so many at a time, here one; two without it
    tools/mutation.py --new machine       without the survivors that are explained: each needs every
                                          test

Each mutant gets the type checker and, where that has nothing against it, the quick tests that reach
its function. Survivors have to stand, with a reason, in tests/mutation/survivors.txt; the run fails
for one that does not, and for an entry that fits no mutant any more. Works on copies in
out/mutation.
"""

import argparse
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
DAEMON = [f"tests/{room}" for room in ("inputs", "gate", "protocols", "controller", "daemon")]
# The groups: rooms, each with the tests that reach it.
TESTS = {
    "checksums": ["tests/codec"],
    "codec": ["tests/codec"],
    "machine": ["tests/machine", "tests/codec"],
    "shaping": ["tests/shaping"],
    "inputs": DAEMON,
    "gate": [*DAEMON, "tests/promises"],
    "protocols": [*DAEMON, "tests/machine/test_gateway_binding.py"],
    "controller": DAEMON,
    "daemon": DAEMON,
    "bus": ["tests/bus"],
}
CORE = [
    f"canshaper.shaping.{name}"
    for name in ("axis", "limits", "output", "state_machine", "transfer")
]
CORE_TESTS = [
    "test_added*.py",
    "test_axis*.py",
    "test_cut_off.py",
    "test_limits.py",
    "test_motion*.py",
    "test_other_plane.py",
    "test_output_stage.py",
    "test_run_on.py",
    "test_sensed.py",
    "test_sets.py",
    "test_small_strokes.py",
    "test_state_machine.py",
    "test_stop_against.py",
    "test_valve_curve.py",
]
COPIED = ["canshaper", "sim", "dbc", "config", "docs", "tools"]
GATE = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["coverage"]["run"]


def modules(group: str) -> list[str]:
    """Return the names of a room's modules that pyproject.toml lists for coverage."""
    return [name for name in GATE["source_pkgs"] if name.split(".")[1] == group]


def prepare(work: Path, mutated: list[str], tests: list[str]) -> None:
    """Empty ``work``; copy to it what the tests need, with the settings of mutmut."""
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
    "-m", "not slow and not processes", "--hypothesis-profile=mutants", "-p", "no:cacheprovider",
    "-p", "no:unraisableexception",  # collects garbage at the end of every run
    "--ignore=tests/gate/test_senders.py",  # counts lines, and each mutant is one more
]
timeout_multiplier = 2.0
use_git_change_detection = false
"""
    )


def run(group: str, patterns: list[str], processes: str, *, new: bool) -> int:
    """Prepare, run, judge a group; return the exit status. ``new``: without explained survivors."""
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
        how = ["run-new", str(SURVIVORS)] if new else ["run"]
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
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("group", nargs="?", choices=[*TESTS, "core"], help="by default all rooms")
    parser.add_argument("patterns", nargs="*", metavar="PATTERN", help="mutants by name")
    parser.add_argument("-j", default=2, type=int, metavar="N", help="so many at a time")
    parser.add_argument("--new", action="store_true", help="without the explained ones")
    chosen = parser.parse_args()
    results = [
        run(group, chosen.patterns, str(chosen.j), new=chosen.new or group == "core")
        for group in ([chosen.group] if chosen.group else TESTS)
    ]
    sys.exit(max(results))
