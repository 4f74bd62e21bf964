"""Protection of messages, taken and sent, bound to the DBC."""

from typing import Literal

from cantools.database.can import Message, Signal

from canshaper.checksums import CHECKSUMS, Checksum
from canshaper.codec.e2e import E2e, Profile1, Profile2
from canshaper.codec.protection import UNPROTECTED, Protection
from canshaper.config.protection import Protected
from canshaper.config.source import Place
from canshaper.machine.lookup import Lookup

# What a checksum of so many bits has to fill.
PARTS = {4: "half of a byte", 8: "byte", 16: "pair of bytes"}


class ProtectionBinder(Lookup):
    """Binds it, or notes every problem."""

    def protection(
        self,
        place: Place,
        config: Protected,
        message: Message,
        use: dict[str, str],
        address: tuple[int, bool],
    ) -> Protection:
        """Protection of a message.

        Args:
            place: of its section in the deployment file.
            config: that section.
            message: the message.
            use: what its other signals are; those of the protection are noted in it.
            address: see ``Lookup.address``.
        """
        if config.e2e is not None:
            return self._e2e(place, config, message, use)
        counter = self.signal((*place, "alive_counter"), message, config.alive_counter)
        if counter:
            self.integer((*place, "alive_counter"), counter, signed=False)
            self.alone((*place, "alive_counter"), counter, use)
            use[counter.name] = "alive_counter"
        return Protection(
            counter.name if counter else None,
            1 << counter.length if counter else 0,
            self._checksum(place, config, message, use, address),
        )

    def _checksum(
        self,
        place: Place,
        config: Protected,
        message: Message,
        use: dict[str, str],
        address: tuple[int, bool],
    ) -> Checksum | None:
        if config.checksum is None:
            return None
        at: Place = (*place, "checksum", "signal")
        kind, (can_id, any_source) = config.checksum.kind, address
        self.kinds.add(kind)
        signal = self.signal(at, message, config.checksum.signal)
        if signal is None:
            return None
        self.alone(at, signal, use)
        use[signal.name] = "checksum"
        bits = CHECKSUMS[kind].bits
        if not _fills(signal, bits):
            text = f"{signal.name} is no unsigned {PARTS[bits]} of its own"
            self.add(at, f"{text}; allowed is one that is")
            return None
        low = min(_bits(signal))
        big = bits > 8 and signal.byte_order == "big_endian"
        order: Literal["little", "big"] = "big" if big else "little"
        checksum = Checksum(kind, low // 8, low % 8, order, can_id)
        if CHECKSUMS[kind].needs_id and any_source:
            text = f"found {kind!r}, which depends on the id, and {message.name} may come from any"
            self.add((*place, "checksum", "kind"), f"{text} source; allowed is it with a known one")
        try:
            checksum.seal(bytes(message.length), 0)
        except Exception as error:  # of a package: now, and not in the first tick
            text = f"found {kind!r}, which fails on {message.name}: {type(error).__name__}: {error}"
            self.add((*place, "checksum", "kind"), text)
        return checksum

    def _e2e(
        self, place: Place, config: Protected, message: Message, use: dict[str, str]
    ) -> Protection:
        for key in ("alive_counter", "checksum"):
            if getattr(config, key) is not None:
                self.add((*place, key), "found besides e2e, which has its own; allowed is one")
        profile = _profile(config)
        at: Place = (*place, "e2e")
        if message.length < 2:
            self.add(at, f"{message.name} has {message.length} bytes, allowed are 2 or more")
            return UNPROTECTED
        for signal in message.signals:
            if min(_bits(signal)) < profile.bits:
                if signal.name in use:
                    text = f"its header takes the first {profile.bits} bits of {message.name}"
                    self.add(at, f"{text}, where {signal.name} lies, which is {use[signal.name]}")
                use[signal.name] = "in the header of e2e"
        return Protection(None, profile.counts, profile)


def _profile(config: Protected) -> E2e:
    e2e = config.e2e
    assert e2e is not None
    if e2e.data_ids is not None:
        return Profile2(e2e.data_ids)
    assert e2e.data_id is not None  # checked with the file
    assert e2e.data_id_mode is not None
    return Profile1(e2e.data_id, e2e.data_id_mode)


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
    """Whether an unsigned integer signal has so many bits, which fill bytes or half of one."""
    places = _bits(signal)
    whole = min(places) % min(bits, 8) == 0 and max(places) - min(places) == bits - 1
    return whole and signal.length == bits and not signal.is_float and not signal.is_signed
