"""A deployment read in another process: the same deployment, every refusal, and no trace left."""

import gc
import os
import select
import signal
import time
import weakref
from collections.abc import Callable
from pathlib import Path

import pytest

from canshaper.cli.common import loader
from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.daemon import config_reload as reading_module
from canshaper.daemon.config_reload import ConfigReload
from canshaper.errors import ConfigError, Problem
from canshaper.machine.deployment import Deployment
from tests.rigs.files import ROOT
from tests.rigs.forwarder import TICK_NS

pytestmark = pytest.mark.processes

SHIPPED = sorted((ROOT / "config").glob("forwarder*.yaml"))
ANSWER_S = 30.0  # only to end a test that hangs
CHANNELS = ["crane=x"]


def read(load: Callable[[], Deployment]) -> Deployment | str:
    return answer(ConfigReload(load))


def answer(reading: ConfigReload) -> Deployment | str:
    until = time.monotonic() + ANSWER_S
    while (result := reading.result()) is None:
        assert time.monotonic() < until
        time.sleep(0.01)
    return result


def drive(deployment: Deployment) -> list[Frame]:
    """Frames of a controller while every joystick goes to its end and back."""
    controller = Controller(deployment)
    sent = []
    for tick in range(300):
        now_ns = tick * TICK_NS
        for joystick in deployment.config.joysticks.values():
            entry = deployment.messages.find(joystick.message)
            assert not isinstance(entry, str)
            message = entry[1]
            values = dict.fromkeys((s.name for s in message.signals), 0)
            joysticks = {a.command.signal for a in deployment.config.axes.values()}
            values |= {name: 900 if 50 < tick < 150 else 0 for name in values if name in joysticks}
            values |= {"Enable": 1, "AliveCounter": tick % 256}
            data = message.encode(values, scaling=False)
            key = (message.frame_id, message.is_extended_frame)
            controller.receive(Frame(joystick.bus, *key, data), now_ns)
        sent += list(controller.tick(now_ns, 0))
    return sent


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_it_is_the_deployment_that_reading_here_gives(path: Path) -> None:
    load = loader(str(path), "virtual", CHANNELS)
    result, here = read(load), load()
    assert isinstance(result, Deployment)
    assert result.config == here.config
    assert (result.path, result.routing.buses["crane"]) == (here.path, here.routing.buses["crane"])
    frames = drive(result)
    assert frames == drive(here)
    assert len({frame.data for frame in frames}) > 100  # something moved


def test_a_wrong_file_is_refused_with_every_line(tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text("tick_ms: 0\nnonsense: 1\n")
    result = read(loader(str(path)))
    with pytest.raises(ConfigError) as here:
        loader(str(path))()
    assert result == str(here.value)
    assert {f"{path}:1:", f"{path}:2:"} <= {line.split(" ")[0] for line in result.splitlines()}


def test_nothing_waits_for_it() -> None:
    waits, ends = os.pipe()

    def load() -> Deployment:
        os.close(ends)
        select.select([waits], [], [], ANSWER_S)
        return loader(str(SHIPPED[0]))()

    reading = ConfigReload(load)
    assert [reading.result() for _ in range(100)] == [None] * 100
    os.close(ends)
    assert isinstance(answer(reading), Deployment)
    os.close(waits)


def test_a_long_answer_comes_whole() -> None:
    """More than a pipe holds: who writes into one would wait for us for ever."""
    problems = [Problem("machine.yaml", line, "axes", "x" * 1900) for line in range(100)]

    def load() -> Deployment:
        raise ConfigError(problems)

    answer_text = str(ConfigError(problems))
    assert read(load) == answer_text
    assert len(answer_text) > 65_536


def test_an_error_no_one_thought_of_is_a_refusal() -> None:
    def load() -> Deployment:
        raise ZeroDivisionError("division by zero")

    assert read(load) == "ZeroDivisionError: division by zero"


@pytest.mark.parametrize(
    ("end", "status"),
    [(lambda: os.kill(os.getpid(), signal.SIGKILL), -9), (lambda: os._exit(7), 7)],
)
def test_a_reader_that_dies_is_a_refusal(end: Callable[[], None], status: int) -> None:
    def load() -> Deployment:
        end()
        raise AssertionError

    assert read(load) == f"its reader ended with status {status}"


def test_a_reader_that_takes_the_memory_is_a_refusal() -> None:
    def load() -> Deployment:
        bytearray(2 * reading_module.MOST_BYTES)
        raise AssertionError

    assert read(load) == "its reader took more than 140 MB"


@pytest.mark.slow
def test_a_reader_that_takes_the_processor_is_a_refusal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading_module, "MOST_CPU_S", 1)

    def load() -> Deployment:
        while True:
            pass

    assert read(load) == "its reader took more than 1 s of a processor"


def test_a_reader_that_never_ends_is_a_refusal_and_leaves_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before = descriptors(), children()
    now_s = [1000.0]
    monkeypatch.setattr(reading_module.time, "monotonic", lambda: now_s[0])

    def load() -> Deployment:
        signal.pause()
        raise AssertionError

    reading = ConfigReload(load)
    now_s[0] += 59.9
    assert reading.result() is None
    now_s[0] += 0.1
    assert reading.result() == "its reader took longer than 60 s"
    assert (descriptors(), children()) == before


def test_its_reader_never_has_the_priority_of_the_loop() -> None:
    """On one processor a reader of equal priority would hold up the loop."""

    def load() -> Deployment:
        raise RuntimeError(f"policy {os.sched_getscheduler(0)}")

    before, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except PermissionError:
        pytest.skip("no right to real-time priority")
    try:
        reading = ConfigReload(load)
    finally:
        os.sched_setscheduler(0, before, parameters)
    assert answer(reading) == f"RuntimeError: policy {os.SCHED_OTHER}"


def descriptors() -> list[str]:
    return sorted(path.name for path in Path("/proc/self/fd").iterdir())


def children() -> str:
    return Path(f"/proc/self/task/{os.getpid()}/children").read_text()


def test_neither_process_nor_file_is_left_after_a_result() -> None:
    before = descriptors(), children()
    for path in (SHIPPED[0], Path("nowhere.yaml")):
        read(loader(str(path)))
    assert (descriptors(), children()) == before


def test_given_up_it_ends_at_once() -> None:
    def load() -> Deployment:
        signal.pause()
        raise AssertionError

    before = descriptors(), children()
    ConfigReload(load).end()
    assert (descriptors(), children()) == before


def test_a_deployment_that_is_replaced_goes_without_a_collector() -> None:
    """The collector looks at nothing that was there at the last reload, cycles would stay."""
    gc.disable()
    try:
        for path in SHIPPED:
            deployment = read(loader(str(path)))
            assert isinstance(deployment, Deployment)
            controller = Controller(deployment)
            list(controller.tick(0, 0))
            gone = weakref.ref(deployment), weakref.ref(controller)
            del deployment, controller
            assert [one() for one in gone] == [None, None]
    finally:
        gc.enable()
