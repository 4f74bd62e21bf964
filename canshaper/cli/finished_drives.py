"""Finished drives for ``canshaper studio``: a log, or drives of a campaign, as choices."""

import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from canshaper.cli.common import channels_of, loader, names_of, os_errors
from canshaper.errors import CampaignError, UsageError

if TYPE_CHECKING:
    from canshaper.machine.deployment import Deployment
    from canshaper.studio.playback import Named, Playback, Window
    from canshaper.studio.playback_app import Choice

MOST_DEPLOYMENTS = 2
"""Most --with options: the page shows three cranes, one of them the recorded or raw one."""
BUNDLE = ".zip"


def is_drive(file: str) -> bool:
    """Return whether the suffix, without .gz, is that of a log, a black box or a recording."""
    from canshaper.recording.log import FORMATS

    suffix = Path(file.lower().removesuffix(".gz")).suffix
    return suffix == BUNDLE or suffix in FORMATS


def opened_drives(
    file: str,
    others: Sequence[str],
    seeds: Sequence[int],
    folder: Path | None,
    *,
    channels: Sequence[str],
    window: "Window",
    changes: Sequence[str],
) -> "list[Choice]":
    """Return the drives that the page offers; the first is driven now, the others when chosen.

    Args:
        file: log, black box or recording; with ``seeds`` or ``folder`` a deployment.
        others: other deployments to show next to it.
        seeds: seeds of drives of a campaign.
        folder: folder of a campaign; its worst drives follow the seeds.
        channels: channels of a log, as BUS=CHANNEL.
        window: begin and end of the part of a log to show, s; end None: up to the end of the log.
        changes: parameters of the simulated crane, as NAME=VALUE.

    Raises:
        UsageError: the options exclude each other, or a log has no deployment.
        CanshaperError: a file or the campaign is wrong, or the first drive cannot be driven.
    """
    if len(others) > MOST_DEPLOYMENTS:
        raise UsageError(f"--with: expected {MOST_DEPLOYMENTS} at most, got {len(others)}")
    if not is_drive(file):
        choices = _drives_of_campaign(file, others, seeds, folder, changes)
    elif seeds or folder:
        raise UsageError(f"--seed, --campaign: expected a deployment file, got the log {file}")
    else:
        choices = [_log(Path(file), others, channels, window, changes)]
    first = choices[0].load()
    choices[0].load = lambda: first
    return choices


def _log(
    path: Path,
    others: Sequence[str],
    channels: Sequence[str],
    window: "Window",
    changes: Sequence[str],
) -> "Choice":
    from canshaper.recording.record import unpack
    from canshaper.report.console import progress_bar
    from canshaper.studio.playback import play_log
    from canshaper.studio.playback_app import Choice
    from canshaper_sim.parameters import changed_parameters

    def load() -> "Playback":
        with os_errors(path), tempfile.TemporaryDirectory() as place:
            log, own = path, []
            if path.suffix.lower() == BUNDLE:
                log, file = unpack(path, Path(place))
                own = [loader(str(file), inside=Path(place))()]
            if not own and not others:
                raise UsageError("--with is missing: which deployment? A log has none")
            deployments = _named([*own, *(loader(one)() for one in others)])
            with progress_bar(path.name) as on_progress:
                return play_log(
                    log,
                    deployments,
                    own=bool(own),
                    channels=channels_of(channels),
                    window=window,
                    parameters=changed_parameters([*changes], deployments[0].deployment),
                    progress=on_progress,
                )

    return Choice(path.name, load)


def _drives_of_campaign(
    file: str,
    others: Sequence[str],
    seeds: Sequence[int],
    folder: Path | None,
    changes: Sequence[str],
) -> "list[Choice]":
    from canshaper.campaign.draw import check_same_axes
    from canshaper.report.console import progress_bar
    from canshaper.studio.playback import play_seed
    from canshaper.studio.playback_app import Choice
    from canshaper_sim.parameters import changed_parameters

    deployments = [loader(one)() for one in (file, *others)]
    for other in deployments[1:]:
        check_same_axes(deployments[0], other)
    nominal, named = changed_parameters([*changes], deployments[0]), _named(deployments)
    titles = {seed: f"drive {seed}" for seed in seeds}
    if folder:
        titles |= _worst(folder, deployments[0], changes)

    def load(seed: int) -> "Playback":
        with progress_bar(titles[seed]) as on_progress:
            return play_seed(named, seed, nominal, on_progress)

    return [Choice(title, partial(load, seed)) for seed, title in titles.items()]


def _worst(folder: Path, deployment: "Deployment", changes: Sequence[str]) -> dict[int, str]:
    """Return the titles of the ten worst drives of a campaign, by seed, the worst one first.

    Raises:
        CampaignError: the folder has no drives, or those of another deployment or other changes.
    """
    from canshaper.campaign.run import Source
    from canshaper.campaign.store import Store
    from canshaper.campaign.summary import FIRST, worst

    if not folder.is_dir():
        raise CampaignError(f"{folder}: expected the folder of a campaign, got none")
    source = Source.of(deployment, deployment.config.uncertainty, changes)
    columns = Store(folder, source.about).columns()
    if not columns:
        raise CampaignError(f"{folder}: expected the drives of a campaign, got none")
    return {
        row["seed"]: f"drive {row['seed']}: {row['operator']}, {row[FIRST]:.1f}° left"
        for row in worst(columns)
    }


def _named(deployments: "Sequence[Deployment]") -> "list[Named]":
    from canshaper.studio.playback import Named

    names = names_of([one.path for one in deployments])
    return [Named(name, one) for name, one in zip(names, deployments, strict=True)]
