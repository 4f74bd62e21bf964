"""Identity of what runs: hashes of the deployment file, its DBC files and the program.

The hashes are recorded when a machine is signed off; log, status and bundle show a later change of
a file or of the program.
"""

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path

from canshaper.codec.status import DIGEST_BITS, Source, StatusCodec, StatusField, status_faults
from canshaper.config.inputs import Status
from canshaper.config.source import Place
from canshaper.machine.lookup import Lookup
from canshaper.machine.protections import bind_protection
from canshaper.shaping.registry import ADDED
from canshaper.shipped import PACKAGE, version


@dataclass(frozen=True)
class Identity:
    """SHA-256 of all that determines the valve commands, but for Python and its other packages.

    Attributes:
        deployment: SHA-256 of the deployment file, in hexadecimal digits.
        dbc: SHA-256 of each DBC file, by its name in the deployment file.
        packages: log line with the SHA-256 of each package module that adds checksum or filter.
    """

    deployment: str
    dbc: dict[str, str]
    packages: tuple[str, ...] = ()

    @property
    def digest(self) -> int:
        """Digest of all hashes in 16 bits, for a display; 1 of 65 536 changes keeps it equal.

        The order of the DBC files counts, their names do not: a copy at other paths is equal.
        """
        parts = [program_sha256(), self.deployment, *self.content]
        together = "\n".join(parts)
        return int(sha256(together.encode()).hexdigest()[: DIGEST_BITS // 4], 16)

    @property
    def content(self) -> list[str]:
        """Hashes of the DBC files, without their names, and lines of the packages."""
        return [*self.dbc.values(), *self.packages]

    def lines(self) -> list[str]:
        """Return the lines for people and logs: the digest, then every hash in full."""
        return [
            f"digest={self.digest:#06x}",
            f"program=sha256:{program_sha256()} version={version()}",
            f"deployment=sha256:{self.deployment}",
            *(f"dbc=sha256:{value} file={name}" for name, value in self.dbc.items()),
            *self.packages,
        ]


def filter_lines(kinds: Iterable[str]) -> Iterator[str]:
    """Yield a log line with package and module SHA-256 of each filter kind that is not ours."""
    for kind in sorted(kinds):
        if point := ADDED.get(kind):
            program = sha256(Path(str(sys.modules[point.module].__file__)).read_bytes())
            owner = f"{point.dist.name} {point.dist.version}" if point.dist else point.value
            yield f"filter=sha256:{program.hexdigest()} kind={kind} package={owner}"


@cache
def program_sha256() -> str:
    """Return the SHA-256 of canshaper's modules on the disk, as they were at the first call."""
    total = sha256()
    for path in sorted(_modules()):
        total.update(f"{path.relative_to(PACKAGE).as_posix()}\n".encode())
        total.update(sha256(path.read_bytes()).digest())
    return total.hexdigest()


def _modules() -> Iterator[Path]:
    for folder, inside, files in os.walk(PACKAGE, onerror=_unreadable):
        # Python creates and removes these files while another program starts.
        inside[:] = (name for name in inside if name != "__pycache__")
        yield from (Path(folder, name) for name in files if name.endswith(".py"))


def _unreadable(error: OSError) -> None:
    raise error


def bind_status(
    lookup: Lookup, place: Place, status: Status | None, fields: Sequence[StatusField[Source]]
) -> tuple[StatusCodec[Source] | None, int]:
    """Bind a status message; return codec and period in ticks, (None, 0) if there is none."""
    if status is None:
        return None, 0
    used = lookup.message(place, status, received=False)
    if not used:
        return None, 0
    for fault in status_faults(used.message, fields):
        used.add_fault(fault)
    used.uses.update(dict.fromkeys((one.name for one in fields), "a signal of the status"))
    protection = bind_protection(used, status)
    message = lookup.sent(status.bus, used.message, protection)
    return StatusCodec(message, fields), lookup.period(used)
