"""Table of the faults of a joystick that can be rehearsed."""

from collections.abc import Iterator
from typing import Any

from cantools.database.can import Signal

from canshaper.codec.frame import Frame, FrameFault, with_source
from canshaper.codec.velocity import FlaggedVelocity, RockerVelocity, Velocity, VelocitySignal
from canshaper.daemon.rehearsal import fault as make
from canshaper.daemon.rehearsal.fault import MS, Alter, Demands, Editor, Fault, S
from canshaper.machine.deployment import Deployment
from canshaper.machine.joysticks import BoundJoystick
from canshaper.shaping.states import Reason

OTHER_SOURCE = 0xFC
# Longest time until a joystick counts as frozen that is rehearsed: a person has to hold it so long.
LONGEST_STUCK_S = 25.0


def joystick_faults(
    deployment: Deployment, joystick: BoundJoystick, demands: Demands
) -> Iterator[Fault]:
    """Yield the faults of one joystick."""
    config, of, protection = joystick.config, joystick.name, joystick.protection
    editor, tick = Editor(joystick), make.tick_ns(deployment)
    axes = tuple(n for n, a in deployment.axes.items() if a.config.command.joystick == of)
    lost_ns = make.lost_ns(deployment, joystick)
    timeout = "R1" if deployment.config.gateway else "JOYSTICK_TIMEOUT"

    def fault(
        kind: str, claim: str, within_ns: int = tick, axes: tuple[str, ...] = axes, **how: Any
    ) -> Fault:
        return Fault(f"{kind}:{of}", claim, axes, within_ns, **how)

    lost, wrong = (
        make.dropped(editor.has),
        make.edited(editor, lambda f: f._replace(data=f.data[:-1])),
    )
    yield fault("silent", timeout, lost_ns, alter=lost)
    yield fault("wrong_length", timeout, lost_ns, alter=wrong)
    same = make.edited(editor, lambda frame: frame._replace())
    yield fault("old_stamp", timeout, lost_ns, alter=same, age_ns=2 * config.timeout_ms * MS)
    if protection.counts:
        half, first = protection.counts // 2, dict[int, int]()
        frozen = make.edited(editor, lambda f: editor.counted(f, lambda n: first.setdefault(0, n)))
        yield fault("frozen_counter", "JOYSTICK_UNTRUSTED", lost_ns, alter=frozen)
        jumping = make.edited(editor, lambda f: editor.counted(f, lambda n: n + half * (n % 2)))
        yield fault("jumping_counter", "JOYSTICK_UNTRUSTED", lost_ns, alter=jumping)
    if protection.check is not None:
        wrong = make.edited(editor, editor.spoiled)
        yield fault("wrong_checksum", "JOYSTICK_UNTRUSTED", lost_ns, alter=wrong)
    yield fault("one_wrong_frame", "R7", alter=wrong, once=True, lasts_ns=S)
    reported = make.reports(FrameFault.FRAMES_LOST)
    yield fault("frames_lost", "FRAMES_LOST", alter=lost, once=True, begin=reported, lasts_ns=S)
    if config.stuck_s < LONGEST_STUCK_S:
        stuck_ns = round((config.stuck_s + 2) * S)
        yield fault("frozen", "JOYSTICK_FROZEN", stuck_ns, alter=_frozen(editor, joystick, demands))
    for reason, codes in fault_codes(joystick).items():
        these = tuple(n for n in axes if deployment.axes[n].config.command.signal in codes)
        raw = {name: code for one in codes.values() for name, code in one.items()}
        kind = reason.name.lower()
        yield fault(kind, reason.name, axes=these, alter=make.put(editor, raw))
    if joystick.any_source and not deployment.config.gateway:
        yield fault("second_joystick", "R8", alter=_twice(editor), lasts_ns=S)
    if enable := joystick.enable:
        yield fault("enable_off", "ENABLE_LOST", alter=make.put(editor, {enable: 0}))
        if joystick.message.get_signal_by_name(enable).length > 1:
            invalid = make.put(editor, {enable: 2})
            yield fault("enable_invalid", "SWITCH_INVALID", alter=invalid)


def _parts(velocity: Velocity) -> list[VelocitySignal]:
    """Return the signals of a velocity that are measurements."""
    if isinstance(velocity, FlaggedVelocity):
        return [velocity.magnitude]
    if isinstance(velocity, RockerVelocity):
        return [velocity.positive, velocity.negative]
    return [velocity]


def _flags(velocity: Velocity) -> list[str]:
    """Return the names of the signals of a velocity that are flags."""
    if isinstance(velocity, FlaggedVelocity):
        return [velocity.neutral, velocity.negative, velocity.positive]
    return []


def _frozen(editor: Editor, joystick: BoundJoystick, demands: Demands) -> Alter:
    """Return a function that freezes a joystick at its first position.

    Once the joystick is nearer to neutral than the frozen position, that nearer position is frozen:
    no frame demands more than the joystick.
    """
    kept: dict[str, Any] = {}
    names = [
        name
        for one in joystick.velocities
        for name in (*_flags(one), *(p.name for p in _parts(one)))
    ]

    def frozen(frame: Frame) -> Frame:
        stands = editor.changed(frame, kept)
        if not kept or not make.no_more(demands.read(stands), demands.read(frame)):
            raw = editor.raw(frame)
            kept.update({name: raw[name] for name in names})
            stands = frame._replace()
        return stands

    return make.edited(editor, frozen)


def fault_codes(joystick: BoundJoystick) -> dict[Reason, dict[str, dict[str, Any]]]:
    """Return raw values that are no measurement: {reason: {velocity: {signal: raw value}}}."""
    found: dict[Reason, dict[str, dict[str, Any]]] = {}
    for velocity in joystick.velocities:
        for part in _parts(velocity):
            for code in _codes(part, joystick.message.get_signal_by_name(part.name)):
                reason = part.read({part.name: code})
                if isinstance(reason, Reason):
                    found.setdefault(reason, {}).setdefault(velocity.name, {part.name: code})
        both = dict.fromkeys(_flags(velocity), 1)
        if isinstance(velocity, RockerVelocity):
            both = {one.name: _full(one) for one in _parts(velocity)}
        if both:
            found.setdefault(Reason.JOYSTICK_CONTRADICTORY, {})[velocity.name] = both
    return found


def _full(part: VelocitySignal) -> int:
    return round((part.full - part.offset) / part.scale)


def _codes(part: VelocitySignal, signal: Signal) -> list[Any]:
    """Return raw values that may be no measurement: those with a name, and at or beyond an end."""
    if signal.is_float:
        return [float("nan"), 2.0 * part.full / part.scale]
    top = (1 << signal.length - signal.is_signed) - 1
    return [*part.special, -top - 1 if signal.is_signed else 0, min(_full(part) + 2, top), top]


def _twice(editor: Editor) -> Alter:
    """Return a function that receives each frame from a second address, too."""

    def twice(frame: Frame) -> tuple[Frame, ...]:
        other = frame._replace(can_id=with_source(frame.can_id, OTHER_SOURCE))
        return (other, frame) if editor.has(frame) and other != frame else (frame,)

    return twice
