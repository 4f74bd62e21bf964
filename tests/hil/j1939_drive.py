"""A drive of the J1939 machine on vcan0, its bus recorded by candump and read by foreign tools.

``python -m tests.hil.j1939_drive --minutes 10``, where vcan0 is (``make j1939`` makes such a
place).
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tests.hil.machine import ANSWER_S, ROOT, candump, service

FILE = ROOT / "config" / "j1939-forwarder.yaml"
DBC = ROOT / "dbc" / "j1939-bjm-avc.dbc"
PROBE = " 7FE#"


def drive(folder: Path, scripts: int = 1, script: str = "pulse-near_far") -> Path:
    """Operator, daemon and plant as processes, the script so many times; the log of candump."""
    log = folder / "drive.log"
    with (
        candump(log, "vcan0"),
        service(folder / "sim.log", "sim", str(FILE)),
        service(folder / "run.log", "run", str(FILE)) as daemon,
    ):
        daemon.wait_log("state=claimed")
        for number in range(scripts):
            name = folder / f"operator-{number}.log"
            with service(name, "operator", str(FILE), "--script", script) as operator:
                assert operator.process.wait() == 0, operator.text()
        assert daemon.end() == 0, daemon.text()
    rows = [row for row in log.read_text().splitlines() if PROBE not in row]
    log.write_text("\n".join(rows) + "\n")
    return log


def not_decoded(log: Path) -> list[str]:
    """Rows that ``cantools decode`` does not know, or cannot read."""
    command = [sys.executable, "-m", "cantools", "decode", "--single-line", "-m", "0x03FFFF00"]
    with log.open("rb") as rows:
        done = subprocess.run([*command, str(DBC)], stdin=rows, capture_output=True, check=True)
    text = done.stdout.decode()
    assert text.count(" :: ") == log.read_text().count("#")
    return [r for r in text.splitlines() if "Unknown frame id" in r or "Failed" in r]


def as_wireshark_sees(log: Path) -> tuple[Counter[tuple[str, str]], list[str]] | None:
    """(group, source) of every frame, and the rows with an error; None without tshark."""
    tshark = shutil.which("tshark")
    if tshark is None:
        return None
    command = [tshark, "-r", str(log), "-d", "can.subdissector,j1939"]
    fields = ["-T", "fields", "-e", "j1939.pgn", "-e", "j1939.src_addr"]
    wrong = ["-Y", "_ws.malformed || _ws.expert.severity >= warning || !j1939"]
    rows, errors = (
        subprocess.run([*command, *more], capture_output=True, text=True, check=True).stdout
        for more in (fields, wrong)
    )
    counts = Counter((row.split("\t")[0], row.split("\t")[-1]) for row in rows.splitlines())
    return counts, errors.splitlines()


def main() -> int:
    """Drive for so long, print every count; status 1 with a frame that is not read."""
    parser = argparse.ArgumentParser(prog="python -m tests.hil.j1939_drive", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="canshaper-j1939-"))
    begin = time.monotonic()
    log = drive(folder, max(1, round(options.minutes * 60.0 / 42.0)), "loading")
    print(f"drove {(time.monotonic() - begin) / 60.0:.1f} min, limit of a wait {ANSWER_S:g} s")
    unknown = not_decoded(log)
    print(f"{log.read_text().count('#')} frames, cantools does not decode {len(unknown)}")
    seen = as_wireshark_sees(log)
    if seen is None:
        print("no tshark here")
        return 1 if unknown else 0
    counts, errors = seen
    for (group, source), count in sorted(counts.items()):
        print(f"PGN {group} from {source}: {count}")
    print(f"tshark: {sum(counts.values())} frames, {len(errors)} with an error")
    return 1 if unknown or errors else 0


if __name__ == "__main__":
    sys.exit(main())
