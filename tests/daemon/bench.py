"""A daemon whose loop, clock and ports are a test's own."""

from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from canshaper.bus.port import Port
from canshaper.codec.frame import BusState, Frame, FrameFault
from canshaper.config.bus import Bus
from canshaper.daemon import daemon as module
from canshaper.daemon import ports as service_ports
from canshaper.daemon import reloads, reporter
from canshaper.daemon.daemon import Daemon
from canshaper.gate import cycle
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.machine.routing import BusRoutes
from tests.rigs.files import text_of
from tests.rigs.forwarder import Rig

BUS = "crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }"
SECOND = f"{BUS}\n  two: {{ interface: socketcan, channel: vcan1 }}"
# From sending to the other sockets of the bus: a few frames have to go first.
UNDER_WAY_NS = 4_000_000
FOREIGN = Frame("crane", 0x200, False, b"\0\0")


class FakePort:
    """A port that receives what comes to its channel, of other ports of ours too, after a while."""

    state = BusState.UP
    waited = 0
    why = ""
    confirmed: bool | None = True

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

    def look(self) -> str:
        return ""

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

    def become(self, name: str) -> None:
        """Have this shipped deployment in the file."""
        self.text = text_of(name)
        self.file.write_text(self.text, encoding="utf-8")

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_ns = 10**12
        self.ports: list[FakePort] = []
        self.faults: list[Callable[[FrameFault], None]] = []  # of each port, how it reports one
        self.routes: list[BusRoutes] = []  # and what it was opened for
        self.sent: list[Frame] = []
        self.script: Callable[[int], None] = lambda number: None
        self.opening: Callable[[str], None] = lambda channel: None
        self.file = folder / "machine.yaml"
        self.become("forwarder")
        self.rig = Rig(self.file)  # for its joysticks
        self._tick = 0
        self._handlers: dict[int, Any] = {}
        for one in (cycle, service_ports):
            monkeypatch.setattr(one, "time", self)
        for one in (module, reporter, cycle):
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
        self, name: str, bus: Bus, fault: Callable[[FrameFault], None], ids: BusRoutes
    ) -> Port:
        self.opening(bus.channel)
        self.faults.append(fault)
        self.routes.append(ids)
        self.ports.append(FakePort(name, bus.channel, self))
        return self.ports[-1]

    def run(self, script: Callable[[int], None]) -> None:
        self.script = script
        Daemon(lambda: load_deployment(self.file)).run()

    def reload(self, old: str = "", new: str = "") -> None:
        """Have the daemon read the file again, with a piece of it replaced."""
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
        """State and reason in the last status of the slew axis."""
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


def at(bench: Bench, acts: dict[int, Callable[[], Any]], last: int = 20) -> None:
    """Run, and do something before these ticks."""

    def script(number: int) -> None:
        bench.joysticks()
        if number in acts:
            acts[number]()
        if number == last:
            bench.stop()

    bench.run(script)
