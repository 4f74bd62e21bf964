"""Ten thousand random drives with faults: no wrong move, and the way back always works.

One again, tick by tick: ``python -m tests.faults SEED --trace``.
"""

import itertools
import random
from collections import Counter
from collections.abc import Callable

import pytest

from canshaper.controller.controller import Controller
from tests.faults import inject
from tests.faults.drive import Drive, plan
from tests.faults.fields import CHECKSUMS
from tests.faults.inputs import Input
from tests.faults.judge import Violation
from tests.faults.lies import JUDGED
from tests.faults.variants import NAMES, machine

DRIVES = 10_000
CHUNK = 250
# So many in ``make test``, in chunks of 15, and with the tests marked slow; the others are a study.
QUICK, OFTEN = 150, 2_500
# Seen after many drives.
RARE = {"another sender unseen", "send failure unseen", "stop unseen"}


def driven(first: int, count: int) -> Counter[str]:
    """Drive these seeds and return their counts; fails for wrong moves."""
    stats: Counter[str] = Counter()
    wrong = []
    for seed in range(first, first + count):
        try:
            stats += Drive(seed).run()
        except Violation as violation:
            wrong.append(str(violation))
    assert not wrong, f"{len(wrong)} of {count} drives:\n" + "\n".join(wrong[:5])
    return stats


@pytest.mark.parametrize("first", range(0, QUICK, 15))
def test_no_fault_makes_a_wrong_move(first: int) -> None:
    assert driven(first, 15)["moves"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "first",
    [
        *range(0, OFTEN, CHUNK),
        *(pytest.param(i, marks=pytest.mark.study) for i in range(OFTEN, DRIVES, CHUNK)),
    ],
)
def test_no_fault_of_many_makes_a_wrong_move(first: int) -> None:
    stats = driven(first, CHUNK)
    # The drives were drives: things moved, stopped and tripped.
    assert stats["moves"] > 0.15 * stats["frames"]
    assert stats["stops"] > 20
    assert stats["trips"] > 100


@pytest.mark.slow
def test_every_fault_is_among_them_often() -> None:
    kinds: Counter[str] = Counter()
    at_once = 0
    for seed in range(DRIVES):
        one, _ = machine(NAMES[seed % len(NAMES)])
        ticks, faults = plan(one, random.Random(f"canshaper faults {seed}"))
        kinds.update(f.kind for f in faults)
        at_once += any(sum(f.active(t) for f in faults) > 1 for t in range(ticks))
    assert kinds.keys() == {*inject.KINDS} - {*inject.SENSOR}  # those machines have no sensors
    assert min(kinds.values()) >= 75, kinds
    assert at_once > DRIVES / 4


def silence_unseen(drive: Drive) -> None:
    for joystick in drive.controller.joysticks.values():
        joystick._timeout_ns = 10**18


def stall_unseen(drive: Drive) -> None:
    drive.controller.stalled = lambda: None


def send_failure_unseen(drive: Drive) -> None:
    """Frames that did not go out are counted, and no more."""
    failed, valves = drive.controller.send_failed, drive.machine.valves
    drive.controller.send_failed = lambda frame: failed(
        frame._replace(can_id=0x7F0) if frame[:3] in valves else frame
    )


def not_neutral_at_the_end(drive: Drive) -> None:
    last = drive.controller.neutral_frames
    drive.controller.neutral_frames = lambda: [f._replace(data=b"\x0a\0") for f in last()]


LIARS: dict[str, Callable[[Drive], None]] = {
    one.__name__.replace("_", " "): one
    for one in (silence_unseen, stall_unseen, send_failure_unseen, not_neutral_at_the_end)
}
LIARS |= {n: lambda drive, lie=lie: lie(drive, drive.machine) for n, lie in JUDGED.items()}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n in RARE else n for n in LIARS]
)
def test_the_judge_catches(name: str) -> None:
    """Each of these does one thing wrong; in the same drive without it nothing is."""
    for seed in itertools.count():
        assert seed < 300, "not caught"
        drive = Drive(seed, Controller)
        LIARS[name](drive)
        try:
            drive.run()
        except Violation:
            break
    Drive(seed, Controller).run()


@pytest.mark.parametrize("name", NAMES)
def test_bits_are_read_as_cantools_reads_them(name: str) -> None:
    rng = random.Random(name)
    one, deployment = machine(name)
    for source in one.inputs.values():
        message = next(
            entry[1]
            for entry in map(deployment.messages.find, _message_names(deployment))
            if not isinstance(entry, str) and entry[1].frame_id == source.key[1]
        )
        for _ in range(50):
            data = rng.randbytes(source.length)
            if page := source.page:  # others of a multiplexed message are not read
                word = int.from_bytes(data, "little")
                word += page.put(source.page_code) - page.put(page.get(word))
                data = word.to_bytes(source.length, "little")
            raw = message.decode(data, decode_choices=False, scaling=False)
            word = int.from_bytes(data, "little")
            steps = {n: source.fields[n].read(value) for n, value in raw.items()}
            assert {n: f.get(word) for n, f in source.fields.items()} == steps
            assert _without_checksum(source, source.data(steps)) == _without_checksum(
                source, message.encode(raw, scaling=False, strict=False)
            )


def _message_names(deployment: object) -> list[str]:
    config = deployment.config  # type: ignore[attr-defined]
    names = [joystick.message for joystick in config.joysticks.values()]
    names += [switch.message for switch in config.switches.values()]
    return [*names, config.emergency_stop.message] if config.emergency_stop else names


def _without_checksum(source: Input, data: bytes) -> bytes:
    at = source.checksum_byte
    return data[:at] + data[at + 1 :] if source.checksum else data


def test_checksums_are_the_known_ones() -> None:
    """The check values of the CRC catalogue, over the digits 1 to 9."""
    digits = b"123456789"
    assert CHECKSUMS["crc8_sae_j1850"](digits) == 0x4B
    assert CHECKSUMS["crc8_autosar"](digits) == 0xDF
    assert CHECKSUMS["sum"](digits) == sum(digits) % 256
    assert CHECKSUMS["xor"](digits) == 0x31
