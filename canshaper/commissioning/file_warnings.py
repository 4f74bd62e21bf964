"""Warnings about a valid deployment file, whose numbers may be meant otherwise."""

from canshaper.commissioning.assumed import assumptions
from canshaper.commissioning.likely_mistakes import likely_mistakes
from canshaper.config.source import Source
from canshaper.errors import Problem
from canshaper.machine.deployment import Deployment
from canshaper.machine.filters import unfit
from canshaper.machine.stopping import rehearsed, unstated


def warnings_of(deployment: Deployment) -> list[Problem]:
    """Filters that do not fit, travel that no one has stated, guesses, likely mistakes."""
    source = Source(deployment.path)
    config = deployment.config
    numbers = (*unfit(config), *unstated(deployment), *rehearsed(config), *assumptions(config))
    return [source.problem(*one) for one in (*numbers, *likely_mistakes(deployment))]
