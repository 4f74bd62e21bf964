"""One daemon, one plant, one hand: sequences of a drive, a fault, the way back.

The judge is an independent candump log (``witness``).
"""

import random
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import can

from tests.hil.frame_faults import AT_ONCE, FAULTS
from tests.hil.hand import LEFT, Hand, with_checksum
from tests.hil.machine import DBC, Service, wait_for
from tests.soak.sensor import KINDS, NAMED, Relay
from tests.soak.sensor_judge import FADED, TAIL, Logged, SlewJudge
from tests.soak.witness import Witness, WrongMove

VALVES = {"Slew": 0x200, "Lift": 0x202}
STATUSES = {"Slew": "SlewSensedStatus", "Lift": "LiftStatus"}
# What is waited for; an emulated machine is too slow to read all the rest.
READ = ("JoystickLeft", *(f"{axis}Command" for axis in VALVES), *STATUSES.values())
STOPPED = ("NEUTRAL_WAIT", "TRIPPED")
FOREIGN = bytes.fromhex("7DEE")
# Valve frames between the mark and the fault: the hand's next frame, and what an emulated machine
# makes of the order of its processes.
SLACK = 5
# Faults of the left joystick that show by its frame and the one before: a busy machine makes them
# long after the mark.
BROKEN: dict[str, Callable[[bytes, bytes], bool]] = {
    "wrong length": lambda before, data: len(data) != len(before),
    "wrong checksum": lambda _before, data: with_checksum(data) != data,
    "frozen counter": lambda before, data: data[7] == before[7],
    "jumping counter": lambda before, data: data[7] != (before[7] + 1) % 256,
}


class Soak:
    """Runs sequences and counts.

    Attributes:
        counts: sequences, faults by name, valve frames and so on.
    """

    def __init__(
        self, daemon: Service, hand: Hand, bus: can.BusABC, log: Path, *, relay: Relay, seed: int
    ) -> None:
        self._daemon = daemon
        self._hand = hand
        self._relay = relay
        self._bus = bus
        ids = (DBC.get_message_by_name(name).frame_id for name in READ)
        bus.set_filters([{"can_id": can_id, "can_mask": 0x7FF} for can_id in ids])
        self._witness = Witness(log, bus)
        self._random = random.Random(seed)
        self.counts: Counter[str] = Counter()
        self._others: dict[str, Callable[[], None]] = {
            "process stopped": self._stop_process,
            "second sender": lambda: self._send(f"200#{FOREIGN.hex().upper()}"),
            "interface down": self._interface_down,
        }
        self._harmless: dict[str, Callable[[], None]] = {
            "clock stepped": self._step_clock,
            "flood": self._flood,
            "reload of a broken file": self._break_file,
            "reload of the good file": lambda: self._daemon.process.send_signal(signal.SIGHUP),
            # Our frames get out all the same, and that is believed.
            "bus-off in words": lambda: self._send("20000040#0000000000000000"),
            "error passive": lambda: self._send("20000004#0020000000000000"),
        }

    def sequence(self) -> None:
        """Ready, drive, fault, stop, way back; a wrong move raises."""
        pick = self._random
        self.counts["sequences"] += 1
        if self.counts["sequences"] % 4 == 0:
            self._sensor_sequence(pick.choice([*KINDS]))
            return
        kind = pick.choice([*FAULTS, *self._others, *self._harmless])
        axis = FAULTS[kind].axis if kind in FAULTS else "Slew"
        self._ready(axis)
        value = pick.choice((-1, 1)) * pick.uniform(30.0, 100.0)
        setattr(self._hand, axis.lower(), round(value, 1))
        self._frames(axis, pick.randrange(5, 120))
        self._marked()
        if kind in self._harmless:
            self._harmless[kind]()
            self._frames(axis, 60)
            state = str(self._status(axis)["State"])
            self.counts[f"after a harmless one: {state}"] += 1
        else:
            self._fault(kind, axis)
        self.counts[kind] += 1

    def _sensor_sequence(self, kind: str) -> None:
        """A fault of the sway sensor in motion, perhaps before it is trusted; to rest with it."""
        pick, hand, judge = self._random, self._hand, SlewJudge()
        self._ready("Slew")
        self._marked()
        hand.slew = pick.choice((-1, 1)) * round(pick.uniform(50.0, 100.0), 1)
        if pick.random() < 0.8 and not self._until_trusted():
            judge.wrong.append("the sensor is not trusted again")
        self._frames("Slew", pick.randrange(1, 60))
        before = self._marked()
        self._relay.change = KINDS[kind](pick)
        after = pick.choice(("held", "released", "reversed"))
        if after == "reversed":
            hand.slew = -hand.slew
        if after != "released":
            self._frames("Slew", FADED + 25)
        held = self._marked()
        hand.slew = 0.0
        self._frames("Slew", TAIL + 40)
        rest = self._marked()
        judge.read_all(before)
        judge.begin_fault()
        judge.read_all(held)
        if not judge.follows():
            given = f"{judge.velocity:.3f} for {judge.command:.3f}"
            judge.wrong.append(f"{judge.sensor}, and not what the joystick commands: {given}")
        judge.read_all(rest)
        if missing := NAMED.get(kind, set()) - {*judge.said}:
            judge.wrong.append(f"{missing} is not reported, only {dict(judge.said)}")
        if judge.stood_still:
            self.counts["not judged: joysticks or daemon stood still"] += 1
            return
        self.counts[kind] += 1
        self.counts["sequences with faults of the sensor"] += 1
        self.counts[f"{kind}, {after}: {judge.sensor}"] += 1
        self.counts["valve frames judged"] += judge.valves
        if judge.wrong:
            raise WrongMove(f"{kind}, {after}: {judge.wrong[:3]} and {len(judge.wrong)} in all")

    def _until_trusted(self) -> bool:
        """Slew to and fro until the sensor is trusted, its way back; whether it is."""
        for place in range(1, 150):
            status = self._status("Slew")
            if str(status["SwaySensor"]) == "TRUSTED":
                self.counts["sensor trusted, then its fault"] += 1
                return True
            if str(status["State"]) in STOPPED:
                return False
            if place % 15 == 0:
                self._hand.slew = -self._hand.slew
        return False

    def _fault(self, kind: str, axis: str) -> None:
        if kind in FAULTS:
            FAULTS[kind].make(self._hand)
        else:
            self._others[kind]()
        wait_for(self._bus, STATUSES[axis], lambda s: str(s["State"]) in STOPPED)
        # The fault goes away with the joystick still deflected: nothing may move.
        self._hand.spoil = lambda _id, data: [data]
        self._hand.enable, self._hand.stop = 1, 0
        self._frames(axis, self._random.randrange(5, 40))
        frames = self._marked()
        frames = frames[_begin(kind, frames) :]
        valves = [data for key, data, _ in frames if key == VALVES[axis]]
        ours = [data[0] for data in valves if data != FOREIGN]
        moving = FAULTS[kind].moving if kind in FAULTS else AT_ONCE
        self._judge(kind, ours, moving + SLACK)
        self.counts["valve frames judged"] += len(ours)

    def _judge(self, kind: str, valves: list[int], moving: int) -> None:
        """A shaped stop may pass through zero; after its time, nothing moves at all."""
        if not valves or valves[-1] != 0:
            raise WrongMove(f"{kind}: not neutral after {len(valves)} frames")
        if any(valves[moving:]):
            raise WrongMove(f"{kind}: frames moved after the first {moving}: {valves}")

    # -- parts ---------------------------------------------------------------------------------

    def _marked(self) -> list[Logged]:
        """Frames of the log from the last mark to now."""
        self._witness.mark()
        return self._witness.until_mark()

    def _drain(self) -> None:
        """Pass over what has come on the bus up to now."""
        with suppress(can.CanError):  # once, when the interface has gone down
            while self._bus.recv(0):
                pass

    def _status(self, axis: str) -> dict:
        self._drain()
        return wait_for(self._bus, STATUSES[axis], lambda s: True)

    def _frames(self, axis: str, count: int) -> None:
        """Let so many valve frames pass from now on."""
        self._drain()
        for _ in range(count):
            wait_for(self._bus, f"{axis}Command", lambda v: True)

    def _ready(self, axis: str) -> None:
        """The stated way back, at most 60 presses of the reset."""
        self._hand.rest()
        self._relay.change = lambda degrees: degrees
        self._send("20000100#0000000000000000")  # the controller has restarted
        for i in range(60):
            self._hand.reset = i % 2
            status = self._status(axis)
            if str(status["State"]) == "READY" and status["RawCommand"] == 0:
                self._hand.reset = 0
                self.counts["ways back"] += 1
                return
        raise AssertionError(f"no way back: {status}\n{self._daemon.text()[-2000:]}")

    def _send(self, frame: str) -> None:
        subprocess.run(["cansend", "vcan0", frame], check=True)

    def _stop_process(self) -> None:
        self._daemon.process.send_signal(signal.SIGSTOP)
        for _ in range(self._random.randrange(15, 60)):  # more than the joysticks' timeout
            wait_for(self._bus, "JoystickLeft", lambda v: True)
        self._marked()  # judged is what comes after
        self._daemon.process.send_signal(signal.SIGCONT)

    def _interface_down(self) -> None:
        subprocess.run(["ip", "link", "set", "vcan0", "down"], check=True)
        time.sleep(self._random.uniform(0.05, 0.5))
        subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
        self._marked()  # judged is what comes after

    def _step_clock(self) -> None:
        now = time.clock_gettime(time.CLOCK_REALTIME)
        step = self._random.choice((-3600.0, 3600.0))
        time.clock_settime(time.CLOCK_REALTIME, now + step)

    def _flood(self) -> None:
        subprocess.run(["cangen", "vcan0", "-g", "2", "-n", "500", "-I", "7A0"], check=True)

    def _break_file(self) -> None:
        file = Path(self._daemon.process.args[-1])  # type: ignore[index]
        good = file.read_text()
        file.write_text(good.replace("deadband_pct: 5", "deadband_pct: 90", 1))
        self._daemon.process.send_signal(signal.SIGHUP)
        self._hand.rest()
        before = self._daemon.text().count("reload=refused")
        until = time.monotonic() + 60.0
        while self._daemon.text().count("reload=refused") == before:
            assert time.monotonic() < until, "no reload=refused in the log"
            time.sleep(0.02)
        file.write_text(good)


def _begin(kind: str, frames: list[Logged]) -> int:
    """Place of the first frame that shows the fault; 0 where the mark is as near.

    A silence begins with the last frame before it: the last one before the valve's first neutral.
    """
    if kind in BROKEN:
        lefts = [place for place, (key, _, _) in enumerate(frames) if key == LEFT]
        pairs = ((frames[a].data, frames[b].data, b) for a, b in pairwise(lefts))
        return next((place for before, data, place in pairs if BROKEN[kind](before, data)), 0)
    shows = [
        place
        for place, (key, data, _) in enumerate(frames)
        if (kind in FAULTS and FAULTS[kind].begins(key.to_bytes(2, "big"), data))
        or (kind == "second sender" and data == FOREIGN)
    ]
    if kind not in ("silent", "emergency stop lost"):
        return shows[0] if shows else 0
    valve = VALVES[FAULTS[kind].axis]
    neutral = next(
        (i for i, (key, data, _) in enumerate(frames) if key == valve and not data[0]), 0
    )
    return max((place for place in shows if place < neutral), default=0)
