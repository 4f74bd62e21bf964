"""What a rehearsed fault should do, what it did, and whether that is the same."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from canshaper.commissioning.rehearsal.reactions import NONE, STOP, TRIP, row_of
from canshaper.daemon.rehearsal.fault import MS, Fault
from canshaper.machine.deployment import Deployment
from canshaper.shaping.states import Reason, State

GOOD, WRONG, UNMADE = "as expected", "NOT as expected", "not made"
STATES = {STOP: State.STOPPING.name, TRIP: State.TRIPPED.name}


@dataclass(frozen=True)
class Verdict:
    """A rehearsed fault, for a table.

    Attributes:
        name: of the fault.
        claim: its row in the table of reactions.
        expected: reaction, and within how many ms it begins.
        happened: states and reasons, in order.
        neutral_ms: from the first altered input until every valve got neutral.
        verdict: whether that is the same.
    """

    name: str
    claim: str
    expected: str
    happened: str
    neutral_ms: float | None
    verdict: str

    def as_dict(self) -> dict[str, Any]:
        """For a file of JSON."""
        return asdict(self)


def judged(fault: Fault, report: Mapping[str, Any], deployment: Deployment) -> Verdict:
    """Judge what the daemon reports of a fault.

    Args:
        fault: that fault.
        report: of the daemon, see ``Rehearsal``.
        deployment: the machine.
    """
    reaction, within_ms = row_of(fault.claim).reaction, fault.within_ns / MS
    events = report["events"]
    stops = [event for event in events if event[2] in STATES.values()]
    texts = dict.fromkeys(f"{e[2]} {e[3]}" for e in stops) or dict.fromkeys(
        str(event[3]) for event in events if not event[2]
    )
    expected = f"{reaction} within {within_ms:g} ms" if reaction != NONE else NONE
    happened = ", ".join(texts) or NONE
    if not report["made"]:
        return Verdict(fault.name, fault.claim, expected, report["why"], None, UNMADE)
    neutral_ms = report["neutral_ms"] if stops else None
    if reaction == NONE:
        right = not stops
    elif not fault.axes:
        right = not stops  # at rest nothing stops; the axes wait, and say why
        expected = "no axis is ready"
    else:
        stop_s = max(axis.config.limits.stop_s for axis in deployment.axes.values())
        most_ms = within_ms + (1000 * stop_s + 100 if reaction == STOP else 0)
        right = bool(stops) and stops[0][2] == STATES[reaction] and stops[0][0] <= within_ms
        right = right and (fault.claim not in Reason.__members__ or stops[0][3] == fault.claim)
        right = right and neutral_ms is not None and neutral_ms <= most_ms
    return Verdict(
        fault.name, fault.claim, expected, happened, neutral_ms, GOOD if right else WRONG
    )
