"""How long, and with how much memory, hostile files are refused.

Each row of ``tests/hostile`` in a process of its own, its start included; first the same for the
shipped deployment, which is good. ``.venv/bin/python benchmarks/hostile.py``.
"""

import argparse

from tests.hostile.inputs import DBC, FILES, LOGS, with_dbc
from tests.hostile.run import run


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="rows whose name has this in it")
    only = parser.parse_args().only
    rows = {"a good deployment": with_dbc("a.dbc", DBC), **FILES, **LOGS}
    worst_s = worst_mb = 0.0
    for name, make in rows.items():
        if only not in name:
            continue
        ran = run(make)
        print(f"{name:42} {ran.seconds:6.2f} s {ran.peak_mb:5d} MB   exit {ran.code}", flush=True)
        worst_s, worst_mb = max(worst_s, ran.seconds), max(worst_mb, ran.peak_mb)
    print(f"{'most':42} {worst_s:6.2f} s {worst_mb:5.0f} MB")


if __name__ == "__main__":
    main()
