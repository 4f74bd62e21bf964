"""Log lines about the running file: its digest, unused messages, filters that do not fit."""

from collections.abc import Callable

import pytest

from canshaper.machine.binding import load_deployment
from tests.daemon.bench import Bench, at


def test_the_digest_of_what_runs_is_sent_once_a_second_and_logged_at_every_change(
    bench: Bench, log: Callable[..., list[str]]
) -> None:
    digests = [load_deployment(bench.file).identity.digest]
    at(bench, {110: lambda: bench.reload("tail_s: 0.2", "tail_s: 0.4")}, last=220)
    digests.append(load_deployment(bench.file).identity.digest)
    status = load_deployment(bench.file).identity_status
    assert status is not None
    values = [status.decode(f.data) for f in bench.sent if f[:3] == status.message.key]
    sent = [one["Digest"] for one in values if one]
    assert sent == [digests[0]] * 3 + [digests[1]] * 2
    assert digests[0] != digests[1]
    logged = [f"INFO identity digest={digest:#06x}" for digest in digests]
    assert log("identity digest=") == logged


OTHER = 'VERSION ""\n\nBO_ 5 Other: 1 A\n SG_ S : 0|16@1- (1,0) [0|0] "" A\n'
NOT_USED = "dbc-warnings=1 of messages and tables in the DBC files that are not used"
A2 = "a1: 0.708, a2: 0.12"
OTHER_SWING = f"{A2}, designed_for: {{ period_s: 1.9, damping_ratio: 0.05 }} }} #"
UNFIT = "unfit=axes.near_far.filter.designed_for.period_s expected a swing of 1.85 to 1.95 s"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "/forwarder.dbc]",
            "/forwarder.dbc, other.dbc]",
            f"{NOT_USED}; canshaper check shows them",
        ),
        (f"{A2} }} #", OTHER_SWING, f"{UNFIT}, got 2.20 s; design it again: canshaper tune"),
    ],
)
def test_a_reload_warns_of_messages_that_are_not_used_and_of_filters_that_no_longer_fit(
    bench: Bench, log: Callable[..., list[str]], old: str, new: str, says: str
) -> None:
    bench.file.with_name("other.dbc").write_text(OTHER, encoding="cp1252")
    before: list[str] = []
    kind = says.partition("=")[0]
    acts = {59: lambda: before.extend(log(kind)), 60: lambda: bench.reload(old, new)}
    at(bench, acts, last=120)
    assert log("reload=applied")
    assert not before
    assert any(line.startswith(f"WARNING {says}") for line in log(kind))
