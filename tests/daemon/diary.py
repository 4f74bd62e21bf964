"""Log lines, frames and calls of a daemon, in their order."""

from collections.abc import Callable, Iterable
from typing import Any

import pytest

from canshaper.blackbox.keeper import BlackBox
from canshaper.daemon import daemon as module
from tests.daemon.bench import Bench, FakePort

SECOND_TICKS = 50


class Diary:
    """All that a daemon does but for its frames, in order; a line each, with its tick."""

    def __init__(self, bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
        self.lines: list[tuple[int, str]] = []
        self.starts: list[int] = []  # times of the ticks, from the first one
        self.pings: list[int] = []
        self.pauses: list[int] = []
        self.boxed: list[tuple[int, bool]] = []
        self._bench = bench
        self._at: dict[int, Callable[[], object]] = {}
        self._last = 0
        diary = self

        class Manager:
            def ready(self, status: str) -> None:
                diary.note(f"ready: {status}")

            def reloading(self) -> None:
                diary.note("reloading")

            def stopping(self) -> None:
                diary.note("stopping")

            def status(self, text: str) -> None:
                diary.note(f"status: {text}")

            def ping(self, now_ns: int) -> None:
                diary.pings.append(now_ns)

        class Collector:
            def freeze(self) -> None:
                diary.note("freeze")

            def pause(self, now_ns: int) -> None:
                diary.pauses.append(now_ns)

        monkeypatch.setattr(module, "ServiceManager", Manager)
        monkeypatch.setattr(module, "Collector", Collector)
        monkeypatch.setattr(module, "refuse_huge_pages", lambda: diary.note("no huge pages"))
        monkeypatch.setattr(module, "lock_memory", lambda: diary.note("memory locked"))
        self._watch_box(monkeypatch)
        send = FakePort.send

        def sends(port: FakePort, frame: Any) -> bool:
            if 0x200 <= frame.can_id <= 0x202:
                diary.note(f"{port.name} {frame.can_id:#x}")
            return send(port, frame)

        monkeypatch.setattr(FakePort, "send", sends)
        bench.opening = lambda channel: diary.note(f"open {channel}")

    def _watch_box(self, monkeypatch: pytest.MonkeyPatch) -> None:
        diary, bench = self, self._bench
        begin, close, after_tick = BlackBox.begin, BlackBox.close, BlackBox.after_tick

        def begins(box: BlackBox, now_ns: int) -> None:
            assert now_ns == bench.now_ns
            diary.note("black box begins")
            begin(box, now_ns)

        def closes(box: BlackBox) -> None:
            diary.note("black box closes")
            close(box)

        def follows(box: BlackBox, now_ns: int, events: Iterable[object], *, neutral: bool) -> None:
            diary.boxed.append((now_ns, neutral))
            after_tick(box, now_ns, events, neutral=neutral)

        monkeypatch.setattr(BlackBox, "after_tick", follows)
        monkeypatch.setattr(BlackBox, "begin", begins)
        monkeypatch.setattr(BlackBox, "close", closes)

    def note(self, line: str) -> None:
        self.lines.append((len(self.starts) - 1, line))

    def run(self, last: int, acts: dict[int, Callable[[], object]] | None = None) -> None:
        """Run so many ticks with the joysticks at rest, and do something before some of them."""

        def script(number: int) -> None:
            self.starts.append(self._bench.now_ns - 10**12)
            self._bench.joysticks()
            (acts or {}).get(number, lambda: None)()
            if number == last:
                self._bench.stop()

        self._bench.run(script)

    def all(self, *, of: str = "") -> list[str]:
        return [line for _, line in self.lines if line.startswith(of)]

    def statuses(self) -> list[tuple[int, str]]:
        return [(tick, line[8:]) for tick, line in self.lines if line.startswith("status: ")]


VALVES = ["crane 0x200", "crane 0x201", "crane 0x202"]
