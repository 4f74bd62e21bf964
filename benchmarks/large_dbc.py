"""A deployment with the DBC file of a whole machine, next to cantools loading that file.

``canshaper check`` of the shipped deployment with thousands of messages more in its DBC file, and
cantools alone; each in a process of its own, its start included, in turn.

    python benchmarks/large_dbc.py [--messages 5000] [--runs 3]
"""

import argparse
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from measure import Figure, medians_s, publish

from tests.hostile.inputs import with_dbc
from tests.hostile.run import run
from tests.machine.large_dbc import large

OURS, PEER = "canshaper check", "cantools loads it"
FIGURES = (Figure("`check` of 5 000 messages, s", PEER),)
LOAD = "import cantools, sys; cantools.database.load_file(sys.argv[1], encoding='cp1252')"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--messages", type=int, default=5000)
    parser.add_argument("--runs", type=int, default=3)
    given = parser.parse_args()
    text = large(given.messages)

    def check() -> None:
        ran = run(with_dbc("a.dbc", text))
        if ran.code:
            raise SystemExit(ran.text)

    with TemporaryDirectory() as folder:
        file = Path(folder) / "a.dbc"
        file.write_text(text, encoding="cp1252")
        peer = [sys.executable, "-c", LOAD, str(file)]
        works = {OURS: check, PEER: lambda: subprocess.run(peer, check=True)}
        times = medians_s(works, given.runs)
    publish(FIGURES, [(times[OURS], times[PEER])])


if __name__ == "__main__":
    main()
