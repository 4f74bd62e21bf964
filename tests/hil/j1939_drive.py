"""A drive of the J1939 machine, its buses recorded by candump and read by foreign tools.

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
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import cantools
import yaml

from tests.hil.machine import ANSWER_S, candump, logged, service
from tests.rigs.files import ROOT

FILE = ROOT / "config" / "j1939-forwarder.yaml"
GROUP_MASK = 0x03FFFF00  # data page, group and destination: from whatever source, of any priority
PROBE = " 7FE#"


def drive(
    folder: Path, scripts: int = 1, script: str = "pulse-near_far", file: Path = FILE
) -> dict[str, Path]:
    """Operator, daemon and plant as processes, the script so many times.

    Returns the log of candump for each channel of the deployment.
    """
    buses = yaml.safe_load(file.read_text())["buses"].values()
    logs = {bus["channel"]: folder / f"drive-{bus['channel']}.log" for bus in buses}
    with ExitStack() as running:
        for channel, log in logs.items():
            running.enter_context(candump(log, channel))
        running.enter_context(service(folder / "sim.log", "sim", str(file)))
        daemon = running.enter_context(service(folder / "run.log", "run", str(file)))
        daemon.wait_log("state=claimed")
        for number in range(scripts):
            name = folder / f"operator-{number}.log"
            with service(name, "operator", str(file), "--script", script) as operator:
                assert operator.process.wait() == 0, operator.text()
        assert daemon.end() == 0, daemon.text()
    for log in logs.values():
        rows = [row for row in log.read_text().splitlines() if PROBE not in row]
        log.write_text("\n".join(rows) + "\n")
    return logs


Key = tuple[bool, int]


def messages_of(file: Path) -> dict[Key, Any]:
    """The messages of a deployment's DBC files as plain cantools reads them."""
    known = {}
    for name in yaml.safe_load(file.read_text())["dbc"]:
        for message in cantools.database.load_file(file.parent / name).messages:
            known[key_of(message.frame_id, extended=message.is_extended_frame)] = message
    return known


def set_points(logs: dict[str, Path], file: Path, axis: str) -> list[int]:
    """Raw set point of each frame that an axis's valve received; neutral is 0."""
    settings = yaml.safe_load(file.read_text())
    valve = settings["axes"][axis]["valve"]
    known = messages_of(file)
    points = []
    for frame in logged(logs[settings["buses"][valve["bus"]]["channel"]]):
        message = known.get(key_of(frame.arbitration_id, extended=frame.is_extended_id))
        if message is not None and message.name == valve["message"]:
            signals = message.decode(frame.data, decode_choices=False, scaling=False)
            points.append(signals[valve["signal"]] - valve.get("zero", 0))
    return points


def not_decoded(log: Path, file: Path = FILE) -> list[str]:
    """Messages that plain cantools does not know by the DBC files of a deployment, or not read."""
    known = messages_of(file)
    wrong = []
    for frame in logged(log):
        try:
            known[key_of(frame.arbitration_id, extended=frame.is_extended_id)].decode(frame.data)
        except (KeyError, cantools.database.DecodeError) as error:
            wrong.append(f"{frame}: {error!r}")
    return wrong


def key_of(can_id: int, *, extended: bool) -> Key:
    """Key of a message: of 29 bits its group, of 11 bits the identifier."""
    return extended, can_id & GROUP_MASK if extended else can_id


def as_wireshark_sees(log: Path) -> tuple[Counter[tuple[str, str]], list[str]] | None:
    """(group, source) of every frame, and the rows with an error; None without tshark."""
    tshark = shutil.which("tshark")
    if tshark is None:
        return None
    command = [tshark, "-r", str(log), "-d", "can.subdissector,j1939"]
    fields = ["-T", "fields", "-e", "j1939.pgn", "-e", "j1939.src_addr"]
    shown = "can.flags.xtd == 1 && (_ws.malformed || _ws.expert.severity >= warning || !j1939)"
    wrong = ["-Y", shown]
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
    log = drive(folder, max(1, round(options.minutes * 60.0 / 42.0)), "loading")["vcan0"]
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
