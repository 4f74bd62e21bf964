"""Binds the protection of received and sent messages to the DBC."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Literal

from cantools.database.can import Signal

from canshaper.codec.message import UNPROTECTED, Protection
from canshaper.config.inputs import Checksum as ChecksumConfig
from canshaper.config.inputs import Protected
from canshaper.config.source import Place
from canshaper.machine.used_message import UsedMessage

if TYPE_CHECKING:
    from canshaper.checksums.kinds import Checksum
    from canshaper.codec.e2e import E2e

# Part of a frame that a checksum of so many bits has to fill.
PARTS = {4: "half of a byte", 8: "byte", 16: "pair of bytes"}


def bind_protection(used: UsedMessage, config: Protected) -> Protection:
    """Bind the protection of a message, and record its signals as used."""
    if config.e2e is not None:
        return _bind_e2e(used, config)
    place: Place = (*used.place, "alive_counter")
    counter = used.integer(place, config.alive_counter, "alive_counter", signed=False)
    return Protection(
        counter.name if counter else None,
        1 << counter.length if counter else 0,
        _bind_checksum(used, config.checksum) if config.checksum else None,
    )


def _bind_checksum(used: UsedMessage, config: ChecksumConfig) -> "Checksum | None":
    from canshaper.checksums.kinds import CHECKSUMS, CRC_WIDTHS, Checksum, crc_kind

    place: Place = (*used.place, "checksum", "signal")
    add, message = used.diagnostics.add, used.message
    signal = used.find(place, config.signal)
    if signal is None:
        return None
    used.use(place, signal, "checksum")
    kind = config.kind
    if kind is None:
        assert config.polynomial is not None  # checked with the file
        numbers = (config.polynomial, config.start, config.end)
        if max(numbers) >> signal.length or signal.length not in CRC_WIDTHS:
            text = f"{signal.name}: expected 8 or 16 bits, as many as the polynomial has"
            add(place, f"{text}, got {signal.length}")
            return None
        kind = crc_kind(signal.length, *numbers, reflected=config.reflected)
    bits = CHECKSUMS[kind].bits
    if not _fills(signal, bits):
        text = f"{signal.name}: expected an unsigned {PARTS[bits]} of its own"
        add(place, f"{text}, got another signal")
        return None
    low = min(_bits(signal))
    big = bits > 8 and signal.byte_order == "big_endian"
    order: Literal["little", "big"] = "big" if big else "little"
    checksum = Checksum(kind, low // 8, low % 8, order, used.can_id)
    place = (*used.place, "checksum", "kind")
    if CHECKSUMS[kind].needs_id and used.any_source:
        text = f"expected a known source with {kind!r}, which depends on the id"
        add(place, f"{text}, got {message.name} from any")
    try:
        checksum.protect(bytes(message.length), 0)
    except Exception as error:  # raised by a package: report it now, not in the first tick
        text = f"{kind!r} fails on {message.name}: {type(error).__name__}: {error}"
        add(place, text)
    return checksum


def _bind_e2e(used: UsedMessage, config: Protected) -> Protection:
    for key in ("alive_counter", "checksum"):
        if getattr(config, key) is not None:
            used.add(key, f"expected one of {key} and e2e, got both")
    profile, message = _profile(config), used.message
    if (least := (profile.bits + 7) // 8) > message.length:
        used.add("e2e", f"{message.name}: expected {least} bytes or more, got {message.length}")
        return UNPROTECTED
    for signal in message.signals:
        if min(_bits(signal)) < profile.bits:
            if use := used.uses.get(signal.name):
                text = f"its header takes the first {profile.bits} bits of {message.name}"
                used.add("e2e", f"{text}, where {signal.name} lies, which is {use}")
            used.uses[signal.name] = "in the header of e2e"
    return Protection(None, profile.counts, profile)


def _profile(config: Protected) -> "E2e":
    from canshaper.codec import e2e as profiles

    e2e = config.e2e
    assert e2e is not None
    if e2e.data_ids is not None:
        return profiles.Profile2(e2e.data_ids)
    assert e2e.data_id is not None  # checked with the file
    if e2e.data_id_mode is not None:
        return profiles.Profile1(e2e.data_id, e2e.data_id_mode)
    by_data_id: dict[str, Callable[[int], E2e]] = {
        "p04": profiles.Profile4,
        "p05": profiles.Profile5,
        "p06": profiles.Profile6,
        "p07": profiles.Profile7,
    }
    return by_data_id[e2e.profile](e2e.data_id)


def _bits(signal: Signal) -> list[int]:
    """Bits of a signal, counted from the lowest one of byte 0."""
    if signal.byte_order == "little_endian":
        return [signal.start + i for i in range(signal.length)]
    bits, at = [], signal.start
    for _ in range(signal.length):
        bits.append(at)
        at += -1 if at % 8 else 15  # after the lowest bit of a byte comes the highest of the next
    return bits


def _fills(signal: Signal, bits: int) -> bool:
    """Return whether a signal is unsigned, has this many bits, and fills whole bytes or a half."""
    places = _bits(signal)
    whole = min(places) % min(bits, 8) == 0 and max(places) - min(places) == bits - 1
    return whole and signal.length == bits and not signal.is_float and not signal.is_signed
