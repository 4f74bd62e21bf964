"""Ten thousand random drives with faults: no wrong move, and the way back always works.

One again, tick by tick: ``python -m tests.faults SEED --trace``.
"""

import itertools
import random
from collections import Counter

import pytest

from tests.faults import inject
from tests.faults.drive import Drive, plan
from tests.faults.fields import CHECKSUMS
from tests.faults.inputs import Input
from tests.faults.judge import Violation
from tests.faults.liars import LIARS, Honest, SecondSenderUnseen, SendFailureUnseen, StopUnseen
from tests.faults.variants import NAMES, machine

DRIVES = 10_000
CHUNK = 250
# So many in ``make test``, in chunks of 15, and with the tests marked slow; the others are a study.
QUICK, OFTEN = 150, 2_500
# Seen after many drives.
RARE = {SecondSenderUnseen, SendFailureUnseen, StopUnseen}


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


@pytest.mark.parametrize(
    "liar",
    [pytest.param(one, marks=pytest.mark.slow) if one in RARE else one for one in LIARS],
    ids=lambda liar: liar.__name__,
)
def test_the_judge_catches(liar: type[Honest]) -> None:
    """Each of these does one thing wrong; an honest one in the same drives does nothing wrong."""
    for seed in itertools.count():
        assert seed < 300, "not caught"
        try:
            Drive(seed, liar).run()
        except Violation:
            break
    Drive(seed, Honest).run()


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
