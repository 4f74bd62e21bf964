"""An instance of the service, seen through systemctl and journalctl."""

import json
import re
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

# Only to end a test that hangs; emulated processors are slow.
ANSWER_S = 60.0
# The administrator's changes of the unit, for all instances.
DROP_IN = Path("/etc/systemd/system/canshaper@.service.d/lane.conf")


def run(*command: str) -> subprocess.CompletedProcess[str]:
    """Run a command and keep what it says, whatever its status."""
    return subprocess.run(command, check=False, capture_output=True, text=True)


def add_vcan(name: str) -> None:
    """Make a virtual bus."""
    subprocess.run(["ip", "link", "add", name, "type", "vcan"], check=True)
    subprocess.run(["ip", "link", "set", name, "up"], check=True)


class Unit:
    """``canshaper@NAME``."""

    def __init__(self, name: str) -> None:
        self.name = f"canshaper@{name}.service"
        self.file = Path(f"/etc/canshaper/{name}.yaml")

    def systemctl(self, verb: str, *options: str, status: int | None = 0) -> str:
        """Run systemctl on the unit; its exit status must be ``status`` (None: any but 0)."""
        done = run("systemctl", verb, *options, self.name)
        good = done.returncode != 0 if status is None else done.returncode == status
        assert good, f"{verb}: {done.returncode} {done.stdout}{done.stderr}\n{self.text()}"
        return done.stdout.strip()

    def show(self, name: str) -> str:
        """A property of the unit."""
        return self.systemctl("show", "--value", "--property", name)

    def number(self, name: str) -> int:
        """A property that is a number."""
        return int(self.show(name))

    def wait(self, meanwhile: Callable[[], object] = lambda: None, **properties: str) -> None:
        """Wait until the properties match these patterns, and do something again and again."""
        until = time.monotonic() + ANSWER_S
        while True:
            meanwhile()
            now = {name: self.show(name) for name in properties}
            if all(re.fullmatch(p, now[n]) for n, p in properties.items()):
                return
            assert time.monotonic() < until, f"{now}, not {properties}\n{self.text()}"
            time.sleep(0.2)

    def wait_restart(self, before: int) -> None:
        """Wait until systemd has started the unit again and it is ready."""
        until = time.monotonic() + ANSWER_S
        while self.number("NRestarts") <= before:
            assert time.monotonic() < until, f"no restart\n{self.text()}"
            time.sleep(0.2)
        self.wait(ActiveState="active")

    def cursor(self) -> str:
        """Where the unit's journal ends now.

        An entry of the unit itself: after another one journalctl 252 leaves out the unit's next.
        """
        last = ("--lines=1", "--output=cat", "--show-cursor", "--quiet")
        shown = run("journalctl", f"--unit={self.name}", *last).stdout
        return shown.rpartition("-- cursor: ")[2].strip()

    def journal(self, cursor: str = "") -> list[dict[str, object]]:
        """Entries of the unit, after a cursor."""
        since = [f"--after-cursor={cursor}"] if cursor else []
        lines = run("journalctl", f"--unit={self.name}", "--output=json", "--all", *since).stdout
        return [json.loads(line) for line in lines.splitlines()]

    def text(self, cursor: str = "") -> str:
        """Messages of the journal."""
        return "\n".join(str(entry["MESSAGE"]) for entry in self.journal(cursor))

    def priority(self, text: str, cursor: str = "") -> set[str]:
        """Priorities of the messages that hold this text: 3 is an error, 6 information."""
        return {str(e["PRIORITY"]) for e in self.journal(cursor) if text in str(e["MESSAGE"])}

    def wait_journal(self, pattern: str, cursor: str) -> None:
        """Wait until the journal has a message like this after the cursor."""
        until = time.monotonic() + ANSWER_S
        while not re.search(pattern, self.text(cursor)):
            assert time.monotonic() < until, f"no {pattern!r}: {self._log(cursor)}"
            time.sleep(0.2)

    def _log(self, cursor: str) -> str:
        return f"{self.show('ActiveState')}, {self.show('StatusText')}\n{self.text(cursor)}"
