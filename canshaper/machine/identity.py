"""Identity of what runs, by content: the deployment file, its DBC files and the program.

They are noted when a machine is signed off; a changed file or program shows in log, status and
bundle.
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
    """SHA-256 of everything that decides what a valve gets, but for Python and its packages.

    Attributes:
        deployment: of the deployment file, in hexadecimal digits.
        dbc: of its DBC files, by their names in the deployment file.
        packages: of the modules of packages that make its checksums and filters, a line for each.
    """

    deployment: str
    dbc: dict[str, str]
    packages: tuple[str, ...] = ()

    @property
    def digest(self) -> int:
        """16 bits for a display: equal only, but for 1 of 65 536, where all hashes are equal.

        The order of the DBC files counts, their names do not: a copy with other paths is the same.
        """
        parts = [program_sha256(), self.deployment, *self.content]
        together = "\n".join(parts)
        return int(sha256(together.encode()).hexdigest()[: DIGEST_BITS // 4], 16)

    @property
    def content(self) -> list[str]:
        """Hashes of the DBC files and packages, whatever names the files have."""
        return [*self.dbc.values(), *self.packages]

    def lines(self) -> list[str]:
        """Lines for people and logs: the digest, then every hash in full."""
        return [
            f"digest={self.digest:#06x}",
            f"program=sha256:{program_sha256()} version={version()}",
            f"deployment=sha256:{self.deployment}",
            *(f"dbc=sha256:{value} file={name}" for name, value in self.dbc.items()),
            *self.packages,
        ]


def filter_lines(kinds: Iterable[str]) -> Iterator[str]:
    """Which package added a filter, with the SHA-256 of its module; no line for one of ours."""
    for kind in sorted(kinds):
        if point := ADDED.get(kind):
            program = sha256(Path(str(sys.modules[point.module].__file__)).read_bytes())
            owner = f"{point.dist.name} {point.dist.version}" if point.dist else point.value
            yield f"filter=sha256:{program.hexdigest()} kind={kind} package={owner}"


@cache
def program_sha256() -> str:
    """Return the SHA-256 of the modules of canshaper on the disk, however they were installed."""
    total = sha256()
    for path in sorted(_modules()):
        total.update(f"{path.relative_to(PACKAGE).as_posix()}\n".encode())
        total.update(sha256(path.read_bytes()).digest())
    return total.hexdigest()


def _modules() -> Iterator[Path]:
    for folder, inside, files in os.walk(PACKAGE, onerror=_unreadable):
        # What Python makes comes and goes while another program starts.
        inside[:] = (name for name in inside if name != "__pycache__")
        yield from (Path(folder, name) for name in files if name.endswith(".py"))


def _unreadable(error: OSError) -> None:
    raise error


def bind_status(
    lookup: Lookup, place: Place, status: Status | None, fields: Sequence[StatusField[Source]]
) -> tuple[StatusCodec[Source] | None, int]:
    """A status message, and the ticks between two of them; (None, 0) where there is none."""
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
