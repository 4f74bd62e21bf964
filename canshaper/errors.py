"""Every exception that canshaper raises for a person to read. The message says what to do.

::

    CanshaperError
     +-- ConfigError            a deployment that must not start; carries every problem
     +-- UsageError             an option or argument cannot be
     +-- BusError               a bus cannot be opened
     |    +-- WrongBusError         it is another device than the deployment names
     |    +-- WrongDeviceError      so is an interface
     |    +-- GatewayError          the kernel's gateway refuses
     +-- InternalError          a part of the program raised what it should not
     +-- ControlError           a running daemon cannot be reached, or refuses
     +-- NodeError              so with a node of CANopen that is to be set
     +-- PageMessageError       what a page sent is no message
     +-- LogError               a log cannot be used
     |    +-- CutOffError           it ends in the middle
     |    +-- BoxError              a black box cannot be used
     |    +-- StateError            nor can the state that is kept in it
     +-- DesignError            a design or simulation that cannot be, or finds nothing that fits
     |    +-- InfeasibleError       no poles keep all requirements
     |    +-- DriveError            a simulated drive could not be made
     +-- NativeError            the C cannot be compiled here, or computes otherwise
     +-- CampaignError          a campaign cannot begin or go on; what is done is kept
     |    +-- WorkerError           a process that drives is not the program that asks it to
     +-- MeasurementError       a measurement failed, or says nothing
          +-- IdentificationError   of the swing
          +-- CalibrationError      of a valve or the pump

Those about data (``UsageError``, ``LogError``, ``DesignError``, ``IdentificationError``,
``PageMessageError``) are ``ValueError`` too.
"""

import re
import traceback
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

# Of one file, and of one problem: a person reads no more.
MOST_PROBLEMS = 100
MOST_LETTERS = 2000
MOST_OF_RAISED = 200  # of an exception of another package


@dataclass(frozen=True)
class Problem:
    """One fault of a file, as a person reads it.

    Attributes:
        file: its name.
        line: in it; None where there is none.
        where: key, message or option.
        message: what was expected and what came.
    """

    file: str
    line: int | None
    where: str
    message: str

    def __str__(self) -> str:
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        text = ": ".join(part for part in (place, self.where, self.message) if part)
        return text if len(text) <= MOST_LETTERS else f"{text[:MOST_LETTERS]} ..."


class CanshaperError(Exception):
    """The root of all."""


class InternalError(CanshaperError):
    """A part of the program raised what it should not; every valve was sent neutral."""


class ConfigError(CanshaperError):
    """A deployment that must not start.

    Attributes:
        problems: every one that was found, in the order of the file.
    """

    def __init__(self, problems: Sequence[Problem]) -> None:
        lines = [str(problem) for problem in problems[:MOST_PROBLEMS]]
        if more := len(problems) - len(lines):
            lines.append(f"and {more} more problems")
        super().__init__("\n".join(lines))
        self.problems = list(problems)


class UsageError(CanshaperError, ValueError):
    """An option or argument of the command cannot be; says what was expected and what came."""


class BusError(CanshaperError):
    """A bus cannot be opened."""


class WrongBusError(BusError):
    """A bus is another device than the deployment names.

    Attributes:
        bus: its name in the deployment file.
        why: what differs, and which interface is the device.
    """

    def __init__(self, bus: str, why: str) -> None:
        super().__init__(f"bus {bus}: {why}")
        self.bus, self.why = bus, why


class WrongDeviceError(BusError):
    """An interface is not the device of the deployment; the message says what differs."""


class GatewayError(BusError):
    """The kernel's gateway cannot do what it is to do."""


class ControlError(CanshaperError):
    """A running daemon cannot be reached, or refuses."""


class NodeError(CanshaperError):
    """A node of CANopen does not answer, or does not take a parameter."""


class PageMessageError(CanshaperError, ValueError):
    """A page sent something that is no message; says what was expected and what came."""


class LogError(CanshaperError, ValueError):
    """A log that cannot be used: says where, what was expected and what came."""


class CutOffError(LogError):
    """A log that ends in the middle; every frame before that has been handed out."""


class BoxError(LogError):
    """A black box that cannot be used."""


class StateError(LogError):
    """A state that cannot be kept, or is not that of such a controller."""


class DesignError(CanshaperError, ValueError):
    """A design or simulation that cannot be, or finds nothing that fits; says what is allowed."""


class InfeasibleError(DesignError):
    """No poles keep all requirements."""


class DriveError(DesignError):
    """A simulated drive could not be made."""


class NativeError(CanshaperError):
    """The controller in C cannot be compiled here, or computes otherwise than Python."""


class CampaignError(CanshaperError):
    """A campaign cannot begin or go on; what is done is kept."""


class WorkerError(CampaignError):
    """A process that is to drive is not the program that asks it to.

    Attributes:
        worker: its address.
    """

    def __init__(self, worker: str, text: str) -> None:
        super().__init__(worker, text)
        self.worker = worker

    def __str__(self) -> str:
        return f"worker {self.args[0]}: {self.args[1]}"


class MeasurementError(CanshaperError):
    """A measurement failed, or says nothing."""


class IdentificationError(MeasurementError, ValueError):
    """Data that show no swing; says why and what to do."""


class CalibrationError(MeasurementError):
    """The measurement makes no curve of a valve, or flow of a pump; says why and what to do."""


def raised(error: BaseException) -> str:
    """Put an exception into one line: ``ZeroDivisionError: division by zero (filter.py:7)``.

    The place is the innermost line of Python that raised it.
    """
    text = " ".join("".join(traceback.format_exception_only(error)).split())[:MOST_OF_RAISED]
    places = list(traceback.walk_tb(error.__traceback__))
    if not places:
        return text
    frame, line = places[-1]
    return f"{text} ({frame.f_code.co_filename}:{line})"


# C0 but tab and line end, DEL, C1; other line ends; what turns the direction of text; surrogates.
_CONTROL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)


def printable(text: str) -> str:
    """The text with control characters as Python would write them, such as ``\\x1b``."""
    return _CONTROL.sub(lambda match: ascii(match[0])[1:-1], text)


# Of more names than these only the nearest are listed.
MOST_LISTED = 20
LISTED = 5


def there_are(name: str, names: Collection[str]) -> str:
    """The end of an error about a name that does not exist: those that do, of many the nearest."""
    if len(names) <= MOST_LISTED:
        return f"; there are {', '.join(names) or 'none'}{did_you_mean(name, names)}"
    folded = {one.casefold(): one for one in names}
    near = [folded[one] for one in get_close_matches(name.casefold(), folded, LISTED, 0.3)]
    listed = ", ".join(near or [*names][:LISTED])
    return f"; there are {len(names)}, such as {listed}{did_you_mean(name, names)}"


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """The end of an error about a name that does not exist; empty where none looks like it."""
    by_folded = {one.casefold(): one for one in names}
    similar = get_close_matches(name.casefold(), by_folded, n=1)
    return f"; did you mean {by_folded[similar[0]]}?" if similar else ""
