"""Work of an operator with a shipped machine."""

from functools import cache
from pathlib import Path

from canshaper.campaign.run import Source
from canshaper.campaign.work import SetUp, Work, learn
from canshaper_sim.operator_model import Known, Skill
from tests.rigs.files import CONFIG, read

ROBUST = str(CONFIG / "forwarder-robust.yaml")
WITHIN = 0.30, 6.0


@cache
def known(*, bypass: bool) -> tuple[Known, ...]:
    return learn(source(), SetUp(bypass=bypass))


def source(*changes: str, file: str = ROBUST) -> Source:
    deployment = read(Path(file))
    return Source.of(deployment, deployment.config.uncertainty, changes)


def works(
    *, bypass: bool, seed: str = "0", speed: float = 0.6, within: tuple[float, float] = WITHIN
) -> Work:
    learned, technique = known(bypass=bypass), (speed, 1.0)
    return Work(
        SetUp(bypass=bypass), "catching", Skill(), learned, (technique, technique), within, seed
    )
