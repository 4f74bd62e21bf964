"""What a reload must not do: set anything going, forget a trip, or take ourselves for another."""

import gc
import logging
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from canshaper.bus.port import Port
from canshaper.codec.frame import BusState, Frame, FrameFault
from canshaper.config.bus import Bus
from canshaper.controller.adjust import Adjuster
from canshaper.controller.controller import Controller
from canshaper.daemon import daemon as module
from canshaper.daemon import loop, reloads, reporter, standstill
from canshaper.daemon import ports as service_ports
from canshaper.daemon.daemon import Daemon
from canshaper.errors import BusError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.machine.routing import BusRoutes
from canshaper.shaping.states import Reason, State
from tests.rigs.forwarder import ROOT, TICK_NS, Rig

BUS = "crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }"
SECOND = f"{BUS}\n  two: {{ interface: socketcan, channel: vcan1 }}"
# From sending to the other sockets of the bus: a few frames have to go first.
UNDER_WAY_NS = 4_000_000
FOREIGN = Frame("crane", 0x200, False, b"\0\0")


class FakePort:
    """A port that hears what comes to its channel, other ports of ours included, after a while."""

    state = BusState.UP

    def __init__(self, name: str, channel: str, bench: "Bench") -> None:
        self.name = name
        self.channel = channel
        self.waiting: list[tuple[int, Frame]] = []
        self.arrived_ns = 0
        self.closed = False
        self._bench = bench

    def frames(self) -> Iterator[Frame]:
        for arrived_ns, frame in self._received(lambda can_id: can_id < 0x200):
            self.arrived_ns = arrived_ns
            yield frame

    def background(self) -> Iterator[Frame]:
        yield from (frame for _, frame in self._received(lambda can_id: can_id >= 0x200))

    def _received(self, selects: Callable[[int], bool]) -> list[tuple[int, Frame]]:
        assert not self.closed
        now_ns = self._bench.now_ns
        received = [(t, f) for t, f in self.waiting if t <= now_ns and selects(f.can_id)]
        self.waiting = [(t, f) for t, f in self.waiting if t > now_ns or not selects(f.can_id)]
        return [(at, frame._replace(bus=self.name)) for at, frame in received]

    def send(self, frame: Frame) -> bool:
        assert not self.closed
        self._bench.sent.append(frame)
        for port in self._bench.ports:
            if port is not self and port.channel == self.channel:
                port.waiting.append((self._bench.now_ns + UNDER_WAY_NS, frame))
        return True

    def watch(self, name: str, ids: BusRoutes) -> None:
        self.name = name

    def fileno(self) -> int:
        return -1

    def close(self) -> None:
        self.closed = True


class Bench:
    """A daemon on buses and a clock of the test's; it runs in no time.

    Attributes:
        script: called before every tick with its number, from 0.
        opening: called when a bus is opened, with its channel.
    """

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_ns = 10**12
        self.ports: list[FakePort] = []
        self.sent: list[Frame] = []
        self.script: Callable[[int], None] = lambda number: None
        self.opening: Callable[[str], None] = lambda channel: None
        self.file = folder / "machine.yaml"
        text = (ROOT / "config" / "forwarder.yaml").read_text(encoding="utf-8")
        self.text = text.replace("../dbc", str(ROOT / "dbc"))
        self.file.write_text(self.text, encoding="utf-8")
        self.rig = Rig(self.file)  # for its joysticks
        self._tick = 0
        self._handlers: dict[int, Any] = {}
        for one in (loop, service_ports):
            monkeypatch.setattr(one, "time", self)
        for one in (module, reporter, loop, standstill):
            monkeypatch.setattr(one, "boottime_ns", lambda: self.now_ns)
        monkeypatch.setattr(module.signal, "signal", self._handlers.__setitem__)
        leave = lambda code: pytest.fail(f"left with {code}")  # noqa: E731
        monkeypatch.setattr(module, "os", SimpleNamespace(_exit=leave))
        monkeypatch.setattr(service_ports, "open_port", self._open)
        monkeypatch.setattr(reloads, "ConfigReload", Read)
        monkeypatch.setattr(module, "Collector", Uncollected)
        for name in ("lock_memory", "refuse_huge_pages"):
            monkeypatch.setattr(module, name, lambda: None)
        run_at_deadlines = module.run_at_deadlines
        monkeypatch.setattr(
            module,
            "run_at_deadlines",
            lambda period_ns, body, *rest: run_at_deadlines(period_ns, self._before(body), *rest),
        )

    def monotonic(self) -> float:
        return self.now_ns / 1e9

    def sleep(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)

    def _before(self, body: Callable[..., bool]) -> Callable[..., bool]:
        def scripted(*arguments: int) -> bool:
            self.script(self._tick)
            self._tick += 1
            return body(*arguments)

        return scripted

    def _open(
        self, name: str, bus: Bus, _fault: Callable[[FrameFault], None], _ids: BusRoutes
    ) -> Port:
        self.opening(bus.channel)
        self.ports.append(FakePort(name, bus.channel, self))
        return self.ports[-1]

    def run(self, script: Callable[[int], None]) -> None:
        self.script = script
        Daemon(lambda: load_deployment(self.file)).run()

    def reload(self, old: str = "", new: str = "") -> None:
        """Tell the daemon to read the file again, with a piece of it replaced."""
        assert old in self.text
        self.file.write_text(self.text.replace(old, new, 1) if old else self.text, encoding="utf-8")
        self._handlers[module.signal.SIGHUP](module.signal.SIGHUP, None)

    def stop(self) -> None:
        self._handlers[module.signal.SIGTERM](module.signal.SIGTERM, None)

    def put(self, *frames: Frame) -> None:
        """Frames of others come to the first bus."""
        for port in self.ports:
            if port.channel == "vcan0" and not port.closed:
                port.waiting += [(self.now_ns, frame) for frame in frames]

    def joysticks(self, **raw: int) -> None:
        self.put(self.rig.joystick("JoystickLeft", **raw), self.rig.joystick("JoystickRight"))

    def reported(self) -> tuple[str, str]:
        """What the last status of the slew axis tells: state and reason."""
        message = self.rig.messages["SlewStatus"]
        frame = next(f for f in reversed(self.sent) if f.can_id == message.frame_id)
        values = message.decode(frame.data)
        return str(values["State"]), str(values["Reason"])

    def moved(self) -> bool:
        """Whether any valve was ever commanded to move."""
        return any(f.data[0] for f in self.sent if 0x200 <= f.can_id <= 0x202)


class Read:
    """A deployment that has been read at once."""

    def __init__(self, load: Callable[[], Deployment]) -> None:
        self._load = load

    def result(self) -> Deployment:
        return self._load()

    def end(self) -> None: ...


class Uncollected:
    """This process is not the daemon's: its garbage is its own."""

    def freeze(self) -> None: ...

    def pause(self, now_ns: int) -> None: ...


# -- a bus that takes its time ---------------------------------------------------------------------


def test_frames_that_queued_while_a_reload_was_refused_move_nothing(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    """The joystick went out meanwhile, and its joystick died."""

    def opening(channel: str) -> None:
        if channel == "vcan1":
            for joystick in [0] * 50 + [1000] * 50:
                bench.joysticks(Slew=joystick)
                bench.now_ns += TICK_NS
            bench.now_ns += 10**9
            raise BusError("bus two: cannot open: no such adapter")

    def script(tick: int) -> None:
        if tick < 10:
            bench.joysticks()
        if tick == 9:
            assert bench.reported() == ("READY", "JOYSTICK_NEUTRAL")
            bench.reload(BUS, SECOND)
        if tick == 100:
            bench.stop()

    bench.opening = opening
    bench.run(script)
    assert "reload=refused bus two: cannot open: no such adapter" in caplog.messages
    assert not bench.moved()
    assert bench.reported() == ("NEUTRAL_WAIT", "JOYSTICK_TIMEOUT")


def test_nor_do_those_of_a_reload_that_was_applied(bench: Bench) -> None:
    """On a bus that stays open: what it says is old, and the next frame has the joystick out."""
    since: list[int] = []

    def opening(channel: str) -> None:
        if channel == "vcan1":
            for _ in range(50):
                bench.joysticks()
                bench.now_ns += TICK_NS

    def script(tick: int) -> None:
        if len(bench.ports) < 2:
            bench.joysticks()
        elif since:
            bench.joysticks(Slew=1000)
        else:
            since.append(tick)
        if tick == 9:
            bench.reload(BUS, SECOND)
        if tick == 100:
            bench.stop()

    bench.opening = opening
    bench.run(script)
    assert [port.channel for port in bench.ports] == ["vcan0", "vcan1"]
    assert not bench.moved()
    assert bench.reported() == ("NEUTRAL_WAIT", "JOYSTICK_NOT_NEUTRAL")


def test_a_bus_that_changes_does_not_take_us_for_a_second_sender(bench: Bench) -> None:
    """What was sent from the old port comes to the new one, some of it after it was opened."""

    def script(tick: int) -> None:
        bench.joysticks()
        if tick == 9:
            bench.reload("bitrate: 250000", "bitrate: 500000")
        if tick == 100:
            bench.stop()

    bench.run(script)
    assert [(port.channel, port.closed) for port in bench.ports] == [("vcan0", True)] * 2
    assert bench.reported() == ("READY", "JOYSTICK_NEUTRAL")


def test_a_second_sender_is_seen_after_it_too(bench: Bench) -> None:
    def script(tick: int) -> None:
        bench.joysticks()
        bench.put(FOREIGN)
        if tick == 9:
            bench.reload("bitrate: 250000", "bitrate: 500000")
        if tick == 30:
            bench.stop()

    bench.run(script)
    assert len(bench.ports) == 2
    assert bench.reported() == ("TRIPPED", "SECOND_SENDER")


@pytest.mark.parametrize("late", [False, True])
def test_what_waits_on_a_bus_that_is_opened_again_is_read(
    bench: Bench, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, late: bool
) -> None:
    """An emergency message comes once: before the old port closes, or while the new one is new."""
    caplog.set_level(logging.INFO, "canshaper")
    text = (ROOT / "config" / "canopen-forwarder.yaml").read_text(encoding="utf-8")
    bench.text = text.replace("../dbc", str(ROOT / "dbc"))
    bench.file.write_text(bench.text, encoding="utf-8")
    emergency = Frame("crane", 0xA0, False, bytes.fromhex("0380810000000000"))
    sleep = bench.sleep

    def opening(_channel: str) -> None:
        if not late:
            bench.put(emergency)

    def sleeping(seconds: float) -> None:
        sleep(seconds)
        if late and seconds == service_ports.ON_THE_BUS_S:
            bench.put(emergency)

    def script(tick: int) -> None:
        if tick == 9:
            bench.opening = opening
            bench.reload("bitrate: 250000", "bitrate: 500000")
        if tick == 30:
            bench.stop()

    monkeypatch.setattr(bench, "sleep", sleeping)
    bench.run(script)
    assert len(bench.ports) == 2
    (line,) = [text for text in caplog.messages if "emergency=0x8003" in text]
    assert line == "bus=crane node=slew state=lost emergency=0x8003"


# -- what was latched ------------------------------------------------------------------------------


def test_a_trip_is_still_there_after_a_reload_and_asks_for_a_reset(bench: Bench) -> None:
    states: list[tuple[str, str]] = []

    def script(tick: int) -> None:
        bench.joysticks(Reset=int(tick in (200, 201)))
        if tick == 5:
            bench.put(FOREIGN)
        if tick in (9, 199, 205):
            states.append(bench.reported())
        if tick == 9:
            bench.reload()
        if tick == 205:
            bench.stop()

    bench.run(script)
    assert states == [("TRIPPED", "SECOND_SENDER")] * 2 + [("READY", "JOYSTICK_NEUTRAL")]


def test_of_what_was_latched_only_a_lost_address_is_not(rig: Rig) -> None:
    axes = rig.controller.axes
    axes["slew"].trip(Reason.EMERGENCY_STOP)
    axes["near_far"].trip(Reason.ADDRESS_LOST)
    rig.run(3)
    assert [rig.state(axis) for axis in axes] == [State.TRIPPED, State.TRIPPED, State.READY]
    before, rig.controller = rig.controller, Controller(rig.deployment)
    rig.controller.carry_over(before)
    assert rig.state("near_far") is State.NEUTRAL_WAIT
    rig.run(3)
    assert (rig.state("slew"), rig.reason("slew")) == (State.TRIPPED, "EMERGENCY_STOP")
    assert [rig.state(axis) for axis in ("near_far", "lift")] == [State.READY] * 2
    rig.run(1, Reset=1)
    rig.run(1)
    assert rig.state("slew") is State.READY


def test_a_reset_that_is_held_through_a_reload_is_no_press(rig: Rig) -> None:
    rig.controller.axes["slew"].trip(Reason.EMERGENCY_STOP)
    rig.run(3, Reset=1)
    before, rig.controller = rig.controller, Controller(rig.deployment)
    rig.controller.carry_over(before)
    rig.run(10, Reset=1)
    assert rig.state("slew") is State.TRIPPED


def test_an_axis_that_is_new_begins_as_ever(changed_rig: Callable[..., Rig], rig: Rig) -> None:
    other = changed_rig({"  lift:\n": "  boom:\n"})
    other.controller.carry_over(rig.controller)
    other.run(3)
    assert other.state("boom") is State.READY


# -- what was before -------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["forwarder-robust", "j1939-forwarder", "canopen-forwarder"])
def test_nothing_is_left_of_the_controller_before(kind: str) -> None:
    """Without the collector, which never looks through what was there at the start again."""
    deployment = load_deployment(ROOT / "config" / f"{kind}.yaml")
    controller = Controller(deployment)
    for now_ns in range(0, 400_000_000, 20_000_000):
        for _ in controller.tick(now_ns):
            pass
    after = Controller(load_deployment(deployment.path))
    after.carry_over(controller)
    adjuster = Adjuster(controller)
    parts = [controller, deployment, *controller.axes.values()]
    gone = [weakref.ref(part) for part in parts]
    gc.disable()
    try:
        del controller, adjuster, deployment, parts
        assert [one() for one in gone] == [None] * len(gone)
        assert after.neutral
    finally:
        gc.enable()


def test_a_reload_after_a_fault_warns_of_no_fault(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    """Its counters begin again without one; a fault that comes then is one to warn of."""

    def script(number: int) -> None:
        if number in (5, 200):
            bench.put(Frame("crane", 0x110, False, b""))
        if number == 100:
            bench.reload()
        if number == 300:
            bench.stop()

    bench.run(script)
    warned = [text.split()[0] for text in caplog.messages if text.startswith("fault=")]
    assert warned == ["fault=WRONG_LENGTH", "fault=WRONG_LENGTH"]


# -- what runs is known ----------------------------------------------------------------------------


def test_the_digest_of_what_runs_is_sent_once_a_second_and_logged_at_every_change(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    digests: list[int] = []

    def script(number: int) -> None:
        if number == 110:
            digests.append(load_deployment(bench.file).identity.digest)
            bench.reload("tail_s: 0.5", "tail_s: 0.4")
        elif number == 220:
            digests.append(load_deployment(bench.file).identity.digest)
            bench.stop()

    with caplog.at_level("INFO", "canshaper"):
        bench.run(script)
    status = load_deployment(bench.file).identity_status
    assert status is not None
    values = [status.decode(f.data) for f in bench.sent if f[:3] == status.sender.key]
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


def test_the_program_is_read_before_a_bus_is_open(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What waits in the sockets grows old while it is read."""
    order: list[str] = []
    monkeypatch.setattr(module, "program_sha256", lambda: order.append("program"))
    bench.opening = lambda channel: order.append("bus")
    bench.run(lambda number: bench.stop())
    assert order == ["program", "bus"]
