"""Cost of a request on the control socket to the loop: good ones, and nonsense of 4 kB.

The time of one ``serve`` with one request that waits: to read it, answer it and send the answer.
"""

import argparse
import itertools
import json
import socket
import statistics
import time
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from canshaper.cli.common import loader
from canshaper.controller.adjust import Adjuster
from canshaper.controller.controller import Controller
from canshaper.daemon.control_server import (
    LEAST_BETWEEN_NS,
    MOST_BYTES,
    MOST_REQUEST,
    ControlServer,
)
from canshaper.shipped import data_directory

RANGES = {
    "axes.slew.sway.period_s": (2.0, 2.6),
    "axes.slew.filter.a1": (0.6, 0.75),
    "axes.slew.limits.max_pct": (50.0, 100.0),
    "axes.near_far.sway.length_m": (1.0, 1.5),
    "axes.near_far.filter.a1": (0.7, 0.75),
    "axes.near_far.limits.max_pct": (50.0, 100.0),
    "axes.lift.limits.max_pct": (50.0, 100.0),
}
LOW = {key: low for key, (low, _) in RANGES.items()}
REQUESTS = {
    "all numbers asked for": b"{}",
    "one number": json.dumps({"set": {"axes.slew.filter.a1": 0.7}}).encode(),
    "every number": json.dumps({"set": LOW | {"axes.slew.filter.a1": 0.7}}).encode(),
    "unknown numbers": json.dumps({"set": {f"k{i}": 1 for i in range(300)}}).encode(),
    "numbers in a list": b"[" + b"1," * 2046 + b"1]",
    "digits": b"9" * MOST_REQUEST,
    "brackets": b"[" * MOST_REQUEST,
    "objects": b'{"a":' * (MOST_REQUEST // 5),
    "escapes": b'"' + b"\\u1234" * 682 + b'"',
    "too long": b"[" * 60_000,
}

TIMES_NS = itertools.count(0, LEAST_BETWEEN_NS)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", type=int, default=500)
    times = parser.parse_args().times
    with TemporaryDirectory() as name:
        folder = Path(name)
        text = (data_directory() / "config" / "forwarder.yaml").read_text(encoding="utf-8")
        text = text.replace("../dbc", str(data_directory() / "dbc"))
        ranges = ", ".join(f"{key}: [{low}, {high}]" for key, (low, high) in RANGES.items())
        file = folder / "machine.yaml"
        file.write_text(f"{text}\ncontrol: {{ adjustable: {{ {ranges} }} }}\n", encoding="utf-8")
        adjuster = Adjuster(Controller(loader(str(file))()))

        def answer(request: Mapping[str, Any], _peer: str) -> Mapping[str, Any]:
            if "set" in request:
                adjuster.change(request["set"])
            return {"adjustable": adjuster.table()}

        server = ControlServer(folder / "control.sock", 0o600)
        for row, data in REQUESTS.items():
            us = sorted(_serve_us(server, folder / "control.sock", answer, data, times))
            print(
                f"{row:22} median {statistics.median(us):6.0f} us   99 %"
                f" {us[len(us) * 99 // 100]:6.0f} us"
            )
        server.close()


def _serve_us(
    server: ControlServer, path: Path, answer: Any, data: bytes, times: int
) -> list[float]:
    times_us = []
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as one:
        one.connect(str(path))
        for _ in range(times + 1):
            one.send(data)
            now_ns = next(TIMES_NS)
            begin = time.perf_counter()
            server.serve(answer, now_ns)
            times_us.append(1e6 * (time.perf_counter() - begin))
            if len(times_us) == 1:  # this one has accepted the connection
                server.serve(answer, next(TIMES_NS))
            one.recv(MOST_BYTES)
    server.serve(answer, next(TIMES_NS))  # it has gone
    return times_us[1:]


if __name__ == "__main__":
    main()
