"""The soak's judge of sensor faults: a right drive passes, each wrong one is reported."""

import pytest

from tests.soak.sensor_judge import JOYSTICK, RATE, STATUS, STEPS, VALVE, Logged, SlewJudge

ACTIVE, TRIPPED, TRUSTED, JUMP = 2, 5, 2, 5
CYCLE_S = 0.02


def log(
    velocities: list[float],
    commands: list[float],
    state: int = ACTIVE,
    sensor: int = JUMP,
    late_s: float = 0.0,
) -> list[Logged]:
    """Frames of a drive, every 20 ms; the second half so much later."""
    frames = []
    for place, (velocity, command) in enumerate(zip(velocities, commands, strict=True)):
        time_s = place * CYCLE_S + (late_s if 2 * place > len(commands) else 0.0)
        opening = abs(velocity) * 0.95 + 0.05 if velocity else 0.0
        raw = round(opening * STEPS) * (1 if velocity > 0 else -1)
        joystick = round(1000 * command).to_bytes(2, "little", signed=True)
        frames += [
            Logged(JOYSTICK, joystick, time_s),
            Logged(VALVE, raw.to_bytes(1, "little", signed=True), time_s),
            Logged(STATUS, bytes([sensor << 4 | state, 0]), time_s),
        ]
    return frames


RISE = [RATE * k for k in range(11)]
PULSE = [*RISE, *[1.0] * 150, *RISE[::-1], *[0.0] * 150]
COMMANDED = [*[1.0] * 160, *[0.0] * 162]


def judged(frames: list[Logged]) -> SlewJudge:
    judge = SlewJudge()
    judge.read_all(frames)
    return judge


def test_a_drive_within_the_limits_passes() -> None:
    judge = judged(log(PULSE, COMMANDED))
    assert not judge.wrong
    assert judge.follows()
    assert not judge.stood_still
    assert judge.valves == len(PULSE)
    assert judge.said == {"JUMP": len(PULSE)}


@pytest.mark.parametrize(
    ("frames", "what"),
    [
        (log(PULSE, COMMANDED, state=TRIPPED), "TRIPPED for reason 0"),
        (log([-v for v in PULSE], COMMANDED), "allowed"),
        (log(PULSE, [0.5 * c for c in COMMANDED]), "allowed"),
        (log([0.0, *PULSE[5:]], COMMANDED[: len(PULSE) - 4]), "quicker than the rates"),
        (log(PULSE, [0.0] * len(PULSE)), "nothing commanded within the tail"),
        (log([*PULSE, 0.1], [*COMMANDED, 0.0]), "nothing commanded within the tail"),
    ],
    ids=["tripped", "against", "faster", "jump", "alone", "after the tail"],
)
def test_what_must_not_be_is_reported(frames: list[Logged], what: str) -> None:
    assert what in " ".join(judged(frames).wrong)


def test_what_the_sensor_still_moves_though_it_is_not_trusted_is_reported() -> None:
    slower, held = [*RISE[:6], *[0.5] * 155], [1.0] * 161
    assert not judged(log(slower, held)).follows()
    assert judged(log(slower, held, sensor=TRUSTED)).follows()
    assert judged(log([*RISE, *[1.0] * 150], held)).follows()


def test_frames_that_came_late_are_seen() -> None:
    assert judged(log(PULSE, COMMANDED, late_s=0.08)).stood_still
