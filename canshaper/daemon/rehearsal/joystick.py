"""Faults of a joystick that are rehearsed."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from canshaper.codec.frame import Frame, FrameFault
from canshaper.codec.identifier import with_source
from canshaper.codec.velocity import FlaggedVelocity, RockerVelocity
from canshaper.daemon.rehearsal.fault import (
    LONGEST_S,
    MS,
    Asked,
    Demands,
    Editor,
    Fault,
    S,
    dropped,
    edited,
    put,
    tick_ns,
)
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import Bound, BoundJoystick
from canshaper.shaping.states import Reason

OTHER_SOURCE = 0xFC


def joystick_faults(deployment: Deployment, joystick: BoundJoystick) -> Iterator[Fault]:
    """Those of one joystick."""
    config, of = joystick.config, joystick.name
    editor, tick = Editor(joystick), tick_ns(deployment)
    axes = tuple(n for n, a in deployment.axes.items() if a.config.command.joystick == of)
    lost_ns = config.timeout_ms * MS + tick
    timeout = "R1" if deployment.config.gateway else "JOYSTICK_TIMEOUT"

    def fault(kind: str, claim: str, within_ns: int = tick, **how: Any) -> Fault:
        return Fault(f"{kind}:{of}", claim, axes, within_ns, **how)

    yield fault("silent", timeout, lost_ns, alter=dropped(editor))
    short = edited(editor, lambda frame: frame._replace(data=frame.data[:-1]))
    yield fault("wrong_length", timeout, lost_ns, alter=short)
    old = edited(editor, lambda frame: frame._replace(data=bytes(frame.data)))
    yield fault("old_stamp", timeout, lost_ns, alter=old, age_ns=2 * config.timeout_ms * MS)
    once, protection = short, joystick.protection
    if protection.counts:
        half = protection.counts // 2
        first: dict[int, int] = {}
        counts = edited(editor, lambda f: editor.counted(f, first.setdefault(0, editor.count(f))))
        yield fault("frozen_counter", "JOYSTICK_UNTRUSTED", lost_ns, alter=counts)
        jumping = edited(
            editor, lambda f: editor.counted(f, editor.count(f) + half * (editor.count(f) % 2))
        )
        yield fault("jumping_counter", "JOYSTICK_UNTRUSTED", lost_ns, alter=jumping)
    if protection.check is not None:
        once = edited(editor, editor.spoiled)
        yield fault("wrong_checksum", "JOYSTICK_UNTRUSTED", lost_ns, alter=once)
    yield fault("one_wrong_frame", "R7", alter=once, once=True, lasts_ns=S)
    lost = dropped(editor)
    reports = FrameFault.FRAMES_LOST
    yield fault("frames_lost", "FRAMES_LOST", alter=lost, once=True, reports=reports, lasts_ns=S)
    stuck_ns = round(config.stuck_s * S)
    if stuck_ns < (LONGEST_S - 5) * S:
        within_ns = stuck_ns + 2 * S
        yield fault("frozen", "JOYSTICK_FROZEN", within_ns, alter=frozen(editor, joystick))
    moved = _half(joystick)
    for claim, reason in CODES.items():
        if read := _codes(joystick, reason, moved):
            these = tuple(n for n in axes if deployment.axes[n].config.command.signal in read)
            coded = _coded(editor, joystick, reason)
            yield Fault(f"{claim.lower()}:{joystick.name}", claim, these, tick, alter=coded)
    if joystick.any_source and not deployment.config.gateway:
        yield fault("second_joystick", "R8", copy=_other_source(editor), lasts_ns=S)
    if joystick.enable is not None:
        yield fault("enable_off", "ENABLE_LOST", alter=put(editor, **{joystick.enable: 0}))
        if _bits(joystick, joystick.enable) > 1:
            invalid = put(editor, **{joystick.enable: 2})
            yield fault("enable_invalid", "SWITCH_INVALID", alter=invalid)


def _bits(bound: Bound[Any], name: str) -> int:
    return next(s.length for s in bound.message.signals if s.name == name)


def _signals(velocity: Any) -> list[str]:
    """Signals that a velocity is read from."""
    if isinstance(velocity, FlaggedVelocity):
        return [velocity.magnitude.name, velocity.neutral, velocity.negative, velocity.positive]
    if isinstance(velocity, RockerVelocity):
        return [velocity.positive.name, velocity.negative.name]
    return [velocity.name]


def _moving(joystick: BoundJoystick) -> list[str]:
    """Signals that move something."""
    return [name for one in joystick.velocities for name in _signals(one)]


def frozen(editor: Editor, joystick: BoundJoystick) -> Callable[[Frame], Frame | None]:
    """Where a joystick was, or was nearer to neutral since: it never stands farther than it is."""
    kept: dict[str, Any] = {}
    names = _moving(joystick)

    def frozen(frame: Frame) -> Frame:
        raw = editor.raw(frame)
        now = {one.name: one.read(raw) for one in joystick.velocities}
        then = {one.name: one.read({**raw, **kept}) for one in joystick.velocities}
        if not kept or not Demands.no_more(_numbers(then), _numbers(now)):
            kept.update({name: raw[name] for name in names})
        return editor.changed(frame, kept)

    return edited(editor, frozen)


def _numbers(read: Mapping[str, float | Reason]) -> Asked:
    return {k: 0.0 if isinstance(v, Reason) else v for k, v in read.items()}


CODES = {
    name: Reason[name]
    for name in (
        "JOYSTICK_ERROR",
        "JOYSTICK_NOT_AVAILABLE",
        "JOYSTICK_OUT_OF_RANGE",
        "JOYSTICK_NOT_A_NUMBER",
        "JOYSTICK_CONTRADICTORY",
    )
}


def _candidates(joystick: BoundJoystick, name: str) -> Iterator[Any]:
    """Raw values of a signal that may be no measurement: the ends of its bits and of its range."""
    signal = next(s for s in joystick.message.signals if s.name == name)
    if signal.is_float:
        yield from (float("nan"), 2.0 * (signal.maximum or 1.0) / signal.scale)
        return
    top = (1 << signal.length - signal.is_signed) - 1
    low = -top - 1 if signal.is_signed else 0
    yield from (top, top - (1 << max(0, signal.length - 8)), low, low + 1)
    for value, step in ((signal.minimum, -1), (signal.maximum, 1)):
        code = round(((value or 0) - signal.offset) / signal.scale)
        yield from (one for one in (code + step, code + 2 * step, code) if low <= one <= top)
    yield from (int(code) for code in signal.choices or {})


def _codes(
    joystick: BoundJoystick, reason: Reason, raw: Mapping[str, Any]
) -> dict[str, dict[str, Any]]:
    """By velocity, the change of one raw value of a frame by which it reads this reason."""
    found: dict[str, dict[str, Any]] = {}
    for velocity in joystick.velocities:
        for name in _signals(velocity):
            for code in _candidates(joystick, name):
                if velocity.read({**raw, name: code}) is reason:
                    found.setdefault(velocity.name, {name: code})
    return found


def _half(joystick: BoundJoystick) -> dict[str, Any]:
    """Raw values of a frame with every velocity at about half."""
    codes, raw = {s.name: s for s in joystick.message.signals}, dict[str, Any]()
    for name in _moving(joystick):
        signal = codes[name]
        value = (signal.maximum or 1) / 2
        raw[name] = value if signal.is_float else round((value - signal.offset) / signal.scale)
    for one in joystick.velocities:
        if isinstance(one, FlaggedVelocity):
            raw |= {one.neutral: 0, one.negative: 0, one.positive: 1}
        elif isinstance(one, RockerVelocity):
            signal = codes[one.negative.name]
            raw[signal.name] = round(-signal.offset / signal.scale)
    return raw


def _coded(
    editor: Editor, joystick: BoundJoystick, reason: Reason
) -> Callable[[Frame], Frame | None]:
    def coded(frame: Frame) -> Frame:
        codes = _codes(joystick, reason, editor.raw(frame)).values()
        return editor.changed(frame, {name: code for one in codes for name, code in one.items()})

    return edited(editor, coded)


def _other_source(editor: Editor) -> Callable[[Frame], Frame | None]:
    def copied(frame: Frame) -> Frame | None:
        other = frame._replace(can_id=with_source(frame.can_id, OTHER_SOURCE))
        return other if editor.has(frame) and other.can_id != frame.can_id else None

    return copied
