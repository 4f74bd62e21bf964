"""Log lines about the running file: its digest, unused messages, filters that do not fit."""

import pytest

from canshaper.machine.binding import load_deployment
from tests.daemon.bench import Bench


def test_the_digest_of_what_runs_is_sent_once_a_second_and_logged_at_every_change(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    digests: list[int] = []

    def script(number: int) -> None:
        if number == 110:
            digests.append(load_deployment(bench.file).identity.digest)
            bench.reload("tail_s: 0.2", "tail_s: 0.4")
        elif number == 220:
            digests.append(load_deployment(bench.file).identity.digest)
            bench.stop()

    with caplog.at_level("INFO", "canshaper"):
        bench.run(script)
    status = load_deployment(bench.file).identity_status
    assert status is not None
    values = [status.decode(f.data) for f in bench.sent if f[:3] == status.message.key]
    sent = [one["Digest"] for one in values if one]
    assert sent == [digests[0]] * 3 + [digests[1]] * 2
    assert digests[0] != digests[1]
    logged = [r.getMessage() for r in caplog.records if "identity digest=" in r.getMessage()]
    assert logged == [f"identity digest={digest:#06x}" for digest in digests]


def test_faults_of_messages_that_are_not_used_are_counted_in_the_log(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    other = 'VERSION ""\n\nBO_ 5 Other: 1 A\n SG_ S : 0|16@1- (1,0) [0|0] "" A\n'
    bench.file.with_name("other.dbc").write_text(other, encoding="cp1252")

    def script(number: int) -> None:
        if number == 60:
            assert "dbc-warnings" not in caplog.text
            bench.reload("/forwarder.dbc]", "/forwarder.dbc, other.dbc]")
        elif number == 120:
            bench.stop()

    with caplog.at_level("INFO", "canshaper"):
        bench.run(script)
    assert "reload=applied" in caplog.text
    warning = "of messages and tables in the DBC files that are not used"
    warning += "; canshaper check shows them"
    assert [text for text in caplog.messages if "dbc-warnings" in text] == [
        f"dbc-warnings=1 {warning}"
    ]


def test_a_filter_that_no_longer_fits_is_reported_in_the_log(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    old = "a1: 0.708, a2: 0.12 } #"
    new = "a1: 0.708, a2: 0.12, designed_for: { period_s: 1.9, damping_ratio: 0.05 } } #"

    def script(number: int) -> None:
        if number == 60:
            assert "unfit" not in caplog.text
            bench.reload(old, new)
        elif number == 120:
            bench.stop()

    with caplog.at_level("INFO", "canshaper"):
        bench.run(script)
    assert "reload=applied" in caplog.text
    says = "expected a swing of 1.85 to 1.95 s, got 2.20 s; design it again: canshaper tune"
    line = f"unfit=axes.near_far.filter.designed_for.period_s {says}"
    assert [text for text in caplog.messages if text.startswith(line)]
