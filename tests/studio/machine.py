"""A machine whose numbers may be changed: its file, its daemon, and a studio that listens to it."""

import re
import subprocess
import sys
from pathlib import Path

from canshaper.commissioning import control_client as client
from tests.rigs.files import machine_file
from tests.studio.conftest import ROOT, Studio, free_groups

PERIOD, A1 = "axes.slew.sway.period_s", "axes.slew.filter.a1"


class Machine:
    """A daemon on a bus of its own, and a studio with ``--adjust``."""

    def __init__(self, folder: Path) -> None:
        self.control = folder / "control.sock"
        ranges = f"{PERIOD}: [1.8, 3.0], {A1}: [0.3, 1.4]"
        control = f"\ncontrol: {{ socket: {self.control}, adjustable: {{ {ranges} }} }}\n"
        self.file = machine_file(folder, "forwarder", more=control)
        self.groups = free_groups()
        self.log = folder / "daemon.log"
        self.start_daemon()
        bus = ("--shadow", "--adjust")
        self.studio = Studio(*bus, file=str(self.file), groups=self.groups)

    def start_daemon(self) -> None:
        """Start it, and wait until it answers."""
        command = [sys.executable, "-m", "canshaper", "run", str(self.file)]
        command += ["--interface", "udp_multicast", "--channel", self.groups[0]]
        with self.log.open("wb") as log:
            self.daemon = subprocess.Popen(command, cwd=ROOT, stdout=log, stderr=log)
        while not self.control.exists():
            assert self.daemon.poll() is None, self.log.read_text()

    def now(self, key: str) -> float:
        """A number of the daemon."""
        return client.table(self.control)[key]["now"]

    def in_file(self, key: str) -> float:
        """A number of the file, of the first axis."""
        match = re.search(rf"{key}: ([0-9.]+)", self.file.read_text(encoding="utf-8"))
        assert match
        return float(match[1])

    def stop(self) -> None:
        """End both."""
        self.studio.stop()
        self.daemon.terminate()
        self.daemon.wait()
