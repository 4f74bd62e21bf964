"""The tests that a change needs first: those of the rooms it touches, and the golden drives.

    tools/quick.py          what differs from main, committed or not
    tools/quick.py BASE     what differs from BASE
    tools/quick.py --all    every room of the daemon, for `make versions`

Tests marked `long` or `processes` are left out, and few examples are made. Two run side by side.
"""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
DAEMON = ("config", "codec", "machine", "shaping", "inputs", "guard", "bus", "protocols")
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
# They take minutes, or another kernel: make test, make test-machines.
NOT_QUICK = {"faults", "fuzz", "hil", "hostile", "lane", "soak", "systemd", "studio"}
OPTIONS = ["-q", "-m", "not long and not processes", "--hypothesis-profile=few"]


def changed(base: str) -> list[Path]:
    """Files that differ from where this branch left ``base``, those that git does not know too."""

    def git(*words: str) -> list[str]:
        done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)
        return done.stdout.split("\n")

    (since, *_) = git("merge-base", "HEAD", base)
    lines = git("diff", "--name-only", since) + git("ls-files", "--others", "--exclude-standard")
    return [Path(line) for line in lines if line]


def tests_of(file: Path) -> list[str]:
    """Tests of the room that a file is in, the innermost that has some."""
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
    """Run the tests in two processes; the status of the first that fails."""
    if arguments == ["--all"]:
        chosen = set(DAEMON)
    else:
        chosen = {test for file in changed(*arguments or ["main"]) for test in tests_of(file)}
    chosen = {
        t for t in chosen if t.split("/")[0] not in NOT_QUICK and (ROOT / "tests" / t).exists()
    }
    print("tests of", *sorted(chosen | {"golden"}), flush=True)
    files: list[Path] = []
    for test in chosen | {"golden"}:
        path = ROOT / "tests" / test
        files += sorted(path.rglob("test_*.py")) if path.is_dir() else [path]
    files = sorted(set(files), key=lambda file: -file.stat().st_size)
    halves = [[str(file.relative_to(ROOT)) for file in files[half::2]] for half in (0, 1)]
    pytest = [sys.executable, "-m", "pytest", *OPTIONS]
    running = [
        subprocess.Popen([*pytest, *half], cwd=ROOT, stdout=subprocess.PIPE, text=True)
        for half in halves
        if half
    ]
    status = 0
    for one in running:
        out, _ = one.communicate()
        print(out, end="")
        status = status or one.returncode
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
