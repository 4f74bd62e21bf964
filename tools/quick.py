"""The tests that a change needs first: those of the rooms it touches, and the golden drives.

    tools/quick.py          what differs from main, committed or not
    tools/quick.py BASE     what differs from BASE
    tools/quick.py --all    every room of the daemon, for `make versions`

Tests marked `slow` or `processes` are left out, and few examples are made.
"""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
DAEMON = ("config", "codec", "machine", "shaping", "inputs", "gate", "bus", "protocols")
DAEMON += ("controller", "daemon")
# Tests of files that are in no room.
TESTS = {
    "config": ["config", "machine"],
    "dbc": ["machine", "codec"],
    "docs": ["docs"],
    "examples": ["config/test_other_packages.py", "controller/test_checksum_package.py"],
    "benchmarks": ["benchmarks"],
    "tools": ["packaging"],
    "sim": ["sim"],
}
# They take minutes, or another kernel: make test-all.
NOT_QUICK = {"faults", "fuzz", "hil", "hostile", "lane", "soak", "systemd", "studio"}
OPTIONS = ["-q", "-m", "not slow and not processes", "--hypothesis-profile=few"]


def changed(base: str) -> list[Path]:
    """Return files that differ from where this branch left ``base``, and those not in git."""

    def git(*words: str) -> list[str]:
        done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)
        return done.stdout.split("\n")

    (since, *_) = git("merge-base", "HEAD", base)
    lines = git("diff", "--name-only", since) + git("ls-files", "--others", "--exclude-standard")
    return [Path(line) for line in lines if line]


def tests_of(file: Path) -> list[str]:
    """Return the paths below tests/ for a file: the test itself, its room's, or none."""
    first, *rest = file.parts
    if first == "tests" and file.name.startswith("test_"):
        return ["/".join(rest)]
    if first in ("canshaper", "tests"):
        for depth in range(len(rest) - 1, 0, -1):
            if (ROOT / "tests").joinpath(*rest[:depth]).is_dir():
                return ["/".join(rest[:depth])]
        return ["codec"] if rest[0] == "checksums" else []
    return TESTS.get(first, ["docs"] if file.suffix == ".md" else [])


def main(arguments: list[str]) -> int:
    """Run the tests that a BASE or --all chooses, on every processor; return pytest's status."""
    if arguments == ["--all"]:
        chosen = set(DAEMON)
    else:
        chosen = {test for file in changed(*arguments or ["main"]) for test in tests_of(file)}
    chosen = {
        t for t in chosen if t.split("/")[0] not in NOT_QUICK and (ROOT / "tests" / t).exists()
    } | {"golden"}
    print("tests of", *sorted(chosen), flush=True)
    paths = [f"tests/{test}" for test in sorted(chosen)]
    spread = ["-n", str(len(os.sched_getaffinity(0))), "--dist", "worksteal"]
    command = [sys.executable, "-m", "pytest", *OPTIONS, *spread, *paths]
    return subprocess.run(command, cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
