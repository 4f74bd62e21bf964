"""Numbers of a running daemon, changed by pages that listen to its machine."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from canshaper.cli.app import app
from canshaper.commissioning import control_client as client
from tests.rigs.files import machine_file
from tests.studio.machine import A1, PERIOD, Machine
from tests.studio.page import Page


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Machine]:
    one = Machine(tmp_path)
    yield one
    one.stop()


class Hand:
    """A person at a page who changes the numbers."""

    def __init__(self, page: Page, who: str) -> None:
        self.page, self.who = page, who
        self.numbers: dict[str, Any] = page.shown.get("numbers", {})
        self.difference: dict[str, str] = {}
        self.until(lambda: bool(self.numbers.get("table")))

    def look(self) -> None:
        shown = self.page.look()
        self.numbers = shown.get("numbers", self.numbers)
        self.difference = shown.get("difference", self.difference)

    def until(self, condition: Any) -> None:
        for _ in range(600):
            if condition():
                return
            self.look()
        pytest.fail(f"not within 20 s: {self.numbers}, refused {self.page.refused}")

    def request(self, what: Any, **more: Any) -> None:
        self.page.send(numbers=what, who=self.who, **more)

    def change(self, **values: float) -> None:
        self.change_of({{"period": PERIOD, "a1": A1}[name]: v for name, v in values.items()})

    def change_of(self, values: dict[str, float]) -> None:
        seen = {key: self.now(key) for key in values}
        self.request({"change": values, "seen": seen})

    def now(self, key: str) -> float:
        return float(self.numbers["table"][key]["now"])

    def changes(self) -> list[tuple[str, dict[str, list[float]]]]:
        return [(one["who"], one["numbers"]) for one in self.numbers["changes"]]


@pytest.mark.slow
def test_a_number_is_changed_undone_and_compared_with_the_one_before(machine: Machine) -> None:
    with machine.studio.page() as page:
        hand = Hand(page, "Aino")
        before = machine.now(PERIOD)
        hand.change(period=2.5)
        hand.until(lambda: hand.now(PERIOD) == 2.5)
        assert machine.now(PERIOD) == 2.5
        for value in (before, 2.5, before):  # A, B, A
            hand.request("swap")
            hand.until(lambda value=value: hand.now(PERIOD) == value)
            assert machine.now(PERIOD) == value
        for value in (2.5, before, 2.5, before):  # every change is undone
            hand.request("undo")
            hand.until(lambda value=value: hand.now(PERIOD) == value)
        assert machine.now(PERIOD) == before
        assert hand.numbers["undo"] == 0
        hand.request("undo")
        hand.until(lambda: page.refused)
        assert page.refused == ["there is no change to take back"]
        assert hand.changes()[0] == ("Aino", {PERIOD: [before, 2.5]})
        assert hand.changes()[-1] == ("Aino, undo", {PERIOD: [2.5, before]})
        assert f"{PERIOD} {before:g} -> 2.5 (Aino)" in page.texts()


@pytest.mark.slow
def test_the_second_writer_gets_the_name_of_the_first(machine: Machine) -> None:
    with machine.studio.page() as one, machine.studio.page() as two:
        first, second = Hand(one, "Aino"), Hand(two, "Björn")
        before = first.now(PERIOD)
        first.change(period=2.5)
        first.until(lambda: first.now(PERIOD) == 2.5)
        second.request({"change": {PERIOD: 2.6}, "seen": {PERIOD: before}})
        second.until(lambda: two.refused)
        assert two.refused == [f"{PERIOD}: is 2.5 by now, changed by Aino; look again"]
        assert machine.now(PERIOD) == 2.5


@pytest.mark.slow
def test_what_is_not_allowed_changes_nothing(machine: Machine) -> None:
    with machine.studio.page() as page:
        hand = Hand(page, "")
        before = machine.now(PERIOD), machine.now(A1)
        hand.change(period=9.0, a1=0.7)
        hand.until(lambda: page.refused)
        assert "expected 1.8 to 3, got 9" in page.refused[-1]
        assert (machine.now(PERIOD), machine.now(A1)) == before
        for nonsense in (
            "all",
            3,
            {"change": 3, "seen": {}},
            {"change": {PERIOD: "1"}, "seen": {}},
        ):
            page.refused.clear()
            hand.request(nonsense)
            hand.until(lambda: page.refused)
            assert "numbers: expected" in page.refused[-1]
        hand.change(period=2.5)
        hand.until(hand.changes)
        assert hand.changes()[-1][0] == f"page {page.hello['page']}"  # who gives no name


@pytest.mark.slow
def test_only_who_has_the_address_changes_and_the_log_names_the_person(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Other users of the PC reach the port too."""
    monkeypatch.delenv("SUDO_USER", raising=False)
    studio = machine.studio
    assert len(studio.url.partition("?token=")[2]) > 20
    with (
        pytest.raises(InvalidStatus) as no,
        connect(f"ws://{studio.host}/ws", origin=f"http://{studio.host}"),
    ):
        pass
    assert no.value.response.status_code == 403
    with studio.page() as page:
        hand = Hand(page, "Aino")
        hand.change(a1=0.7)
        hand.until(lambda: hand.now(A1) == 0.7)
    assert f"set {A1}=0.7 was=0.708 by={client.person()}/Aino uid=" in machine.log.read_text()


@pytest.mark.slow
def test_what_others_change_is_seen(machine: Machine) -> None:
    with machine.studio.page() as page:
        hand = Hand(page, "Aino")
        hand.change(a1=0.7)
        hand.until(lambda: hand.now(A1) == 0.7)
        client.change(machine.control, {PERIOD: 2.2})
        hand.until(lambda: hand.now(PERIOD) == 2.2)
        assert hand.changes()[-1][0].startswith("another program")
        assert hand.numbers["undo"] == 0  # the way back is no longer known


@pytest.mark.slow
def test_the_file_gets_what_is_in_force_once_its_difference_was_seen(machine: Machine) -> None:
    before = machine.file.read_text()
    with machine.studio.page() as page:
        hand = Hand(page, "Aino")
        hand.change(period=2.5)
        hand.until(lambda: hand.now(PERIOD) == 2.5)
        hand.request("difference")
        hand.until(lambda: hand.difference)
        lines = hand.difference["text"].splitlines()
        assert [line for line in lines if line[0] == "+" and "2.5" in line]
        assert machine.file.read_text() == before
        machine.file.write_text(before + "# by another editor\n")
        hand.request("write", hash=hand.difference["hash"])
        hand.until(lambda: page.refused)
        assert "changed by someone else meanwhile; nothing was written" in page.refused[-1]
        assert machine.file.read_text() == before + "# by another editor\n"
        hand.difference = {}
        hand.request("difference")
        hand.until(lambda: hand.difference)
        hand.request("write", hash=hand.difference["hash"])
        hand.until(lambda: any("Aino wrote" in text for text in page.texts()))
        assert machine.in_file("period_s") == 2.5
        assert machine.file.read_text().endswith("# by another editor\n")
        hand.difference = {}
        hand.request("difference")
        hand.until(lambda: hand.difference)
        assert hand.difference["text"] == ""


@pytest.mark.slow
def test_a_daemon_that_is_gone_is_reported_and_its_return_too(machine: Machine) -> None:
    with machine.studio.page() as page:
        hand = Hand(page, "Aino")
        machine.daemon.terminate()
        machine.daemon.wait()
        hand.until(lambda: "no daemon with a control section?" in hand.numbers["fault"])
        hand.change(period=2.5)
        hand.until(lambda: page.refused)
        machine.start_daemon()
        hand.until(lambda: hand.numbers["fault"] == "")
        assert hand.now(PERIOD) == machine.now(PERIOD)


def test_only_a_machine_of_ones_own_file_is_adjusted(tmp_path: Path) -> None:
    def refusal(*arguments: str) -> str:
        result = CliRunner().invoke(app, ["studio", "--port", "0", *arguments])
        assert result.exit_code == 2, result.output
        return " ".join(result.output.split())

    assert "--adjust, --control: expected with --shadow --adjust" in refusal("--adjust")
    assert "--adjust: shipped with the package; copy it" in refusal("--shadow", "--adjust")
    own = str(machine_file(tmp_path, "forwarder"))
    assert "this file has no control section" in refusal(own, "--shadow", "--adjust")
