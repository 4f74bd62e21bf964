"""Frames that an inline gateway passes, and the kernel's rules of can-gw that pass them."""

from collections.abc import Iterator

from canshaper.codec.frame import EFF_FLAG, NULL, WITHOUT_PRIORITY, group_mask, group_of
from canshaper.codec.layout import is_j1939
from canshaper.codec.rewrite import RewrittenMessage, kernel_check
from canshaper.machine.deployment import Deployment
from canshaper.machine.joysticks import BoundJoystick
from canshaper.protocols.gateway.cangw import Rule, changed_bytes
from canshaper.protocols.gateway.forwarding import Pattern, all_but, exactly


def excluded(deployment: Deployment) -> frozenset[Pattern]:
    """Return patterns of the frames that the gateway does not pass while the daemon runs.

    These are the frames of the joysticks, which only the daemon forwards; all frames that we send,
    so that no one else can send them through the gateway; and those that the deployment blocks.
    """
    gateway = deployment.config.gateway
    assert gateway is not None  # only such deployments are asked
    patterns = {
        _of(joystick)
        for joystick in deployment.joysticks.values()
        if joystick.key[0] in gateway.between
    }
    for bus in gateway.between:
        routes = deployment.routing.buses[bus]
        patterns |= {
            _whatever_priority(can_id) if routes.j1939 and extended else exactly(can_id, extended)
            for can_id, extended in routes.sent
        }
    for name in gateway.blocked:
        message = deployment.messages.find(name)
        assert not isinstance(message, str)  # checked with the deployment
        can_id, extended = message[1].frame_id, message[1].is_extended_frame
        if is_j1939(message[1]):
            patterns.add(_group(can_id, None if can_id & 0xFF == NULL else can_id & 0xFF))
        else:
            patterns.add(exactly(can_id, extended))
    return frozenset(patterns)


def patterns(deployment: Deployment) -> list[Pattern]:
    """Return patterns of all other frames; the gateway passes them unchanged in both directions."""
    return all_but(excluded(deployment))


def passing_rules(deployment: Deployment) -> list[Rule]:
    """Return the kernel's rules that pass the frames of ``patterns``."""
    ends = channels(deployment)
    return [Rule(a, b, p) for a, b in (ends, ends[::-1]) for p in patterns(deployment)]


def fallback_rules(deployment: Deployment) -> list[Rule]:
    """Return the kernel's rules for joystick frames while the daemon is away; none: they stop."""
    gateway = deployment.config.gateway
    assert gateway is not None
    rules = []
    for joystick, message in _passed(deployment):
        source = deployment.config.buses[joystick.key[0]].channel
        destination = deployment.config.buses[message.key[0]].channel
        if gateway.fallback == "pass":
            rules.append(Rule(source, destination, _of(joystick)))
        elif gateway.fallback == "neutral":
            rules.append(Rule(source, destination, _of(joystick), _neutral(message)))
    return rules


def _passed(deployment: Deployment) -> Iterator[tuple[BoundJoystick, RewrittenMessage]]:
    """Yield each joystick whose frames leave on the other bus, with the rewritten message."""
    seen = set()
    for axis in deployment.axes.values():
        joystick, message = deployment.joysticks[axis.config.command.joystick], axis.valve.message
        if isinstance(message, RewrittenMessage) and joystick.name not in seen:
            seen.add(joystick.name)
            yield joystick, message


def _of(joystick: BoundJoystick) -> Pattern:
    """Return the pattern of a joystick's frames; in J1939 at any priority."""
    _, can_id, extended = joystick.key
    if joystick.by_group:
        return _group(can_id, None if joystick.any_source else can_id & 0xFF)
    return _whatever_priority(can_id) if is_j1939(joystick.message) else exactly(can_id, extended)


def _whatever_priority(can_id: int) -> Pattern:
    """Return the pattern of one J1939 id (same source and destination) at any priority."""
    return Pattern(can_id & WITHOUT_PRIORITY | EFF_FLAG, WITHOUT_PRIORITY | EFF_FLAG)


def _group(can_id: int, source: int | None) -> Pattern:
    """Return the pattern of a J1939 group, from one source address or (None) from all."""
    mask, value = group_mask(can_id) | EFF_FLAG, group_of(can_id) | EFF_FLAG
    return Pattern(value, mask) if source is None else Pattern(value | source, mask | 0xFF)


def channels(deployment: Deployment) -> tuple[str, str]:
    """Return the interfaces of the gateway's two buses, in the order of the file."""
    gateway = deployment.config.gateway
    assert gateway is not None  # only such deployments are asked
    first, second = (deployment.config.buses[bus].channel for bus in gateway.between)
    return first, second


def _neutral(message: RewrittenMessage) -> tuple[tuple[int, bytes], ...]:
    """Return the ``changes`` of a rule that put all axes in a joystick's frame into neutral."""
    length = message.fields.message.length
    checks, clear = kernel_check(message.protection, length)
    return (*changed_bytes(~(message.ours_mask | clear), message.neutral_bits(), length), *checks)
