"""Measured on SocketCAN: stops of the daemon's process, and silence of a joystick.

The witness is the kernel: every frame has its time of arrival on the bus. Where a busy host must
not count, run it in a machine of its own with a steady clock:

    python -m tests.lane --steady --rw docs --timeout 3000 -- .venv/bin/python -m tests.hil.stops
    ... -m tests.hil.stops --write            the same, and its figures into docs/safety.md
"""

import argparse
import random
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path

import can

from tests.hil.figures import T_MS, TICK_MS, Silence, Stop, write
from tests.hil.machine import ANSWER_S, DBC, FILE, Service, open_bus, service

CHANNEL = "vcan0"
LEFT, RIGHT, SLEW, STATUS = 0x110, 0x111, 0x200, 0x300
SEEN = [{"can_id": i, "can_mask": 0x7FF, "extended": False} for i in (LEFT, SLEW, STATUS)]
READY, TRIPPED, LOOP_STALLED = 1, 5, 67
OUT_PCT = 90.0
CYCLE_S = 0.02
# A command that has not changed by more than its rounding for so many frames.
STEADY_FRAMES = 5
# Of the filter itself, from frame to frame; the stop begins with ten steps and more.
MOST_RIPPLE = 5
STEPS_MS = range(60, 181, 5)


def _frame(name: str, **signals: float) -> bytes:
    message = DBC.get_message_by_name(name)
    rest = {"AntiSwayOff": 0, "Reset": 0, "AliveCounter": 0}
    joysticks = {s.name: 0.0 for s in message.signals if s.unit == "%"}
    return bytes(message.encode({**joysticks, **rest, **signals}))


class Hand(threading.Thread):
    """Both joysticks, every 20 ms, and what the bus says; frames are made once: it takes no time.

    Attributes:
        data: frame of the left joystick, but for its counter.
        silent: it sends nothing.
    """

    out = _frame("JoystickLeft", Slew=OUT_PCT, Enable=1)
    neutral = _frame("JoystickLeft", Enable=1)
    released = _frame("JoystickLeft", Enable=0)
    right = _frame("JoystickRight", Enable=1)

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self._bus = open_bus(CHANNEL)
        self.data, self.silent = self.released, False
        self._ended = threading.Event()

    def run(self) -> None:
        count = 0
        while not self._ended.wait(CYCLE_S):
            count = (count + 1) % 256
            for can_id, data in ((LEFT, self.data), (RIGHT, self.right)):
                if can_id == LEFT and self.silent:
                    continue
                frame = can.Message(
                    arbitration_id=can_id, is_extended_id=False, data=data[:7] + bytes((count,))
                )
                with suppress(can.CanError):
                    self._bus.send(frame)

    def end(self) -> None:
        self._ended.set()
        self.join()
        self._bus.shutdown()


class Bench:
    """A daemon in motion, a hand, and a witness."""

    def __init__(self, daemon: Service, hand: Hand, bus: can.BusABC, seed: int = 0) -> None:
        self._daemon, self._hand, self._bus = daemon, hand, bus
        self._rng = random.Random(seed)
        self._last: dict[int, can.Message] = {}  # that was read, by id

    def _messages(self, seconds: float) -> Iterator[can.Message]:
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            if message := self._bus.recv(left):
                self._last[message.arbitration_id] = message
                yield message

    def _seen(self, seconds: float) -> list[can.Message]:
        """Frames of that time, behind the last ones that were read before."""
        return [*self._last.values(), *self._messages(seconds)]

    def _wait(self, accept: Callable[[can.Message], bool]) -> None:
        for message in self._messages(ANSWER_S):
            if accept(message):
                return
        raise AssertionError(f"no such frame within {ANSWER_S:g} s:\n{self._daemon.text()}")

    def _status(self, state: int) -> None:
        self._wait(lambda m: m.arbitration_id == STATUS and m.data[0] & 0x0F == state)

    def moving(self) -> None:
        """Neutral, ready, and out until the command stands still.

        Once more where the machine of the test itself stood still.
        """
        hand = self._hand
        hand.silent, hand.data = False, hand.released
        self._status_not_moving()
        hand.data = hand.neutral
        self._status(READY)
        hand.data = hand.out
        last, same = 0, 0

        tripped = False

        def steady(message: can.Message) -> bool:
            nonlocal last, same, tripped
            tripped |= message.arbitration_id == STATUS and message.data[0] & 0x0F == TRIPPED
            if message.arbitration_id == SLEW:
                value = message.data[0]
                same = same + 1 if abs(value - last) <= 1 and value > 20 else 0
                last = value
            return tripped or same >= STEADY_FRAMES

        self._wait(steady)
        if tripped:
            self.moving()

    def _status_not_moving(self) -> None:
        count = 0

        def neutral(message: can.Message) -> bool:
            nonlocal count
            if message.arbitration_id == SLEW:
                count = 0 if message.data[0] else count + 1
            return count >= STEADY_FRAMES

        self._wait(neutral)

    def _stopped(self, stop_s: float) -> None:
        self._daemon.process.send_signal(signal.SIGSTOP)
        time.sleep(stop_s)
        self._daemon.process.send_signal(signal.SIGCONT)

    def stop(self, stop_ms: float) -> Stop:
        """The process is stopped in motion for so long, at any time of its tick."""
        self.moving()
        time.sleep(self._rng.uniform(0.0, CYCLE_S))
        self._stopped(stop_ms / 1000)
        seen = self._seen(0.15)
        valve = [m for m in seen if m.arbitration_id == SLEW]
        gaps = [(b.timestamp - a.timestamp) * 1000 for a, b in pairwise(valve)]
        at = max(range(len(gaps)), key=gaps.__getitem__)
        after = [m.data[0] for m in valve[at + 1 :]]
        reasons = [m.data[1] for m in seen if m.arbitration_id == STATUS and m.data[0] == TRIPPED]
        return Stop(stop_ms, gaps[at], after[0] == 0, not any(after), LOOP_STALLED in reasons)

    def silence(self, *, stopped: bool) -> Silence | None:
        """The joystick falls silent in motion, perhaps with a stop that is over in time.

        Returns:
            None where that stop was not over in time, or the filter let the command fall before.
        """
        self.moving()
        time.sleep(self._rng.uniform(0.0, CYCLE_S))
        self._hand.silent = True
        stop_s = self._rng.uniform(0.02, 0.1) if stopped else 0.0
        if stopped:
            time.sleep(self._rng.uniform(0.0, 0.11 - stop_s))
            self._stopped(stop_s)
        ended_s = time.time()
        seen = self._seen(0.25)
        last_s = max(m.timestamp for m in seen if m.arbitration_id == LEFT)
        valve = [m for m in seen if m.arbitration_id == SLEW]
        fallen = next(b for a, b in pairwise(valve) if b.data[0] < a.data[0] - MOST_RIPPLE)
        falls_ms = (fallen.timestamp - last_s) * 1000
        late = stopped and (ended_s - last_s) * 1000 > T_MS + TICK_MS
        return None if late or falls_ms < T_MS else Silence(falls_ms, stopped)


@contextmanager
def bench(folder: Path) -> Iterator[Bench]:
    """The shipped machine on vcan0."""
    hand = Hand()
    with (
        service(folder / "daemon.log", "run", str(FILE)) as daemon,
        can.Bus(
            interface="socketcan", channel=CHANNEL, can_filters=SEEN, ignore_config=True
        ) as bus,
    ):
        bus.set_filters(SEEN)
        daemon.wait_log("started file=")
        hand.start()
        try:
            yield Bench(daemon, hand, bus)
        finally:
            hand.end()


def main() -> int:
    """Measure, print, and perhaps write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100, help="stops, and silences of each kind")
    parser.add_argument("--write", action="store_true", help="write docs/safety.md")
    options = parser.parse_args()
    stops: list[Stop] = []
    silences: list[Silence] = []
    with tempfile.TemporaryDirectory() as name, bench(Path(name)) as running:
        for number in range(options.count):
            stops.append(running.stop(STEPS_MS[number % len(STEPS_MS)]))
            print(stops[-1], flush=True)
        for stopped in (False, True):
            while sum(s.stopped is stopped for s in silences) < options.count:
                if silence := running.silence(stopped=stopped):
                    silences.append(silence)
                    print(silence, flush=True)
    return write(stops, silences, rewrite=options.write)


if __name__ == "__main__":
    sys.exit(main())
