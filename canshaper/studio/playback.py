"""A finished drive for the page: a replayed log or black box, or a drive of a campaign."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from canshaper.campaign.draw import draw_drive
from canshaper.codec.frame import Frame
from canshaper.design.lockstep import Simulation, driven_part
from canshaper.errors import CutOffError
from canshaper.machine.deployment import Deployment
from canshaper.recording.log import LogFile
from canshaper.recording.replay import Drive, Replay, look
from canshaper.studio.crane import SimulatedPose
from canshaper.studio.in_process import CraneFilm
from canshaper.studio.stage import RAW
from canshaper_sim.crane import CraneParameters

RECORDED = "recorded"
"""Name of the film from a log's own frames; the others are replays."""
QUIET_S = 1.0
"""A gap between ticks or frames of a log that is longer, s, is left out of the pictures."""

Window = tuple[float, float | None]
"""Begin and end of the pictures that are kept, s; None for the end of the drive."""
Progress = Callable[[float], None]
"""Called with the part that is done, 0 to 1."""


@dataclass(frozen=True)
class Named:
    """A deployment and its name on the page."""

    name: str
    deployment: Deployment


@dataclass
class Playback:
    """A finished drive.

    Attributes:
        title: title of the drive.
        axes: names of the axes, equal for all its cranes.
        parameters: the crane to draw.
        films: one film for each of its cranes.
        notes: notes to read before relying on the drive.
    """

    title: str
    axes: list[str]
    parameters: CraneParameters
    films: list[CraneFilm] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """Return title, notes, pictures by crane, and all events by time, for JSON."""
        events = sorted(event for film in self.films for event in film.events)
        return {
            "title": self.title,
            "notes": self.notes,
            "cranes": {f.name: {"numbers": f.numbers, "pictures": f.pictures} for f in self.films},
            "events": events,
        }


def play_log(
    path: Path,
    deployments: Sequence[Named],
    *,
    own: bool,
    channels: Mapping[str, str],
    window: Window,
    parameters: CraneParameters,
    progress: Progress,
) -> Playback:
    """Replay a log with each deployment; a log that is no black box is also shown as recorded.

    Args:
        path: the log, or a black box.
        deployments: at least one; all have the axes of the first one.
        own: the first deployment came with the log, in one bundle.
        channels: channel by bus from the command line.
        window: begin and end of the pictures to keep, s.
        parameters: the simulated crane behind the valve frames of each replay.
        progress: see ``Progress``; it restarts with each deployment.

    Raises:
        LogError: the log cannot be used, or does not fit one of the deployments.
        OSError: a black box cannot be read.
    """
    first = deployments[0].deployment
    playback = Playback(path.name, list(first.axes), parameters)
    start_ns: int | None = None
    drives = [look(one.deployment, path, channels, own=own and one is deployments[0])
              for one in deployments]  # fmt: skip
    for one, drive in zip(deployments, drives, strict=True):
        film = CraneFilm(one.name, one.deployment, *window)
        start_ns = _replayed(film, one.deployment, drive, start_ns, playback, progress=progress)
        playback.films.append(film)
    if drives[0].box is None and start_ns is not None:
        film = CraneFilm(RECORDED, first, *window)
        _recorded(film, drives[0], first, start_ns)
        if film.view.received_any:
            playback.films.insert(0, film)
    if any(film.full for film in playback.films):
        playback.notes.append("only the first ten minutes are shown; --from and --to choose others")
    return playback


def _replayed(
    film: CraneFilm,
    deployment: Deployment,
    drive: Drive,
    start_ns: int | None,
    playback: Playback,
    *,
    progress: Progress,
) -> int | None:
    """Replay a log into a film, and add notes; return ``start_ns``, or the first tick if None."""
    replay = Replay(deployment, drive)
    pose = None
    if SimulatedPose.fits(deployment):
        pose = SimulatedPose(film.view, deployment, playback.parameters)
    tick_s = deployment.config.tick_ms / 1000.0
    before_s = 0.0
    for tick, result in replay.run(progress):
        if start_ns is None:
            start_ns = tick.now_ns
        now_s = (tick.now_ns - start_ns) / 1e9
        if now_s - before_s > QUIET_S:
            film.leap(now_s)
        before_s = now_s
        for _, frame in tick.received:
            film.receive(frame, now_s)
        for frame in result.sent:
            film.receive(frame, now_s)
        if pose:
            pose.advance(tick_s, now_s)
        film.advance(now_s)
        if film.full:
            break
    else:
        replay.check_joysticks()
    playback.notes += [f"{film.name}: {text}" for text in (replay.ticks_of(), *replay.warnings())]
    verdict = replay.verdict
    if verdict.compared:
        same = f"{verdict.different} not the same" if verdict.different else "all the same"
        playback.notes.append(f"{film.name}: {verdict.compared} frames compared, {same}")
    return start_ns


def _recorded(film: CraneFilm, drive: Drive, deployment: Deployment, start_ns: int) -> None:
    """Fill a film from the frames of a log alone, up to its end or the film's."""
    before_s = 0.0
    for now_s, frame in _frames(drive, start_ns):
        if now_s >= 0.0:
            film.advance(min(now_s, before_s + QUIET_S))
            if now_s - before_s > QUIET_S:
                film.leap(now_s)
            before_s = now_s
        film.receive(frame, now_s)
        if film.full:
            return


def _frames(drive: Drive, start_ns: int) -> Iterator[tuple[float, Frame]]:
    """Yield (s since start_ns, frame) of a log that is no black box, until it is cut off."""
    try:
        for time_ns, channel, can_id, extended, data in LogFile(drive.path):
            if bus := drive.channels.get(channel):
                yield (time_ns - start_ns) / 1e9, Frame(bus, can_id, extended, data)
    except CutOffError:
        return  # the replay has said so


def play_seed(
    deployments: Sequence[Named], seed: int, nominal: CraneParameters, progress: Progress
) -> Playback:
    """Repeat a drive of a campaign with each deployment; the last film is without anti-sway.

    Args:
        deployments: at least one; the drive is drawn from the ranges of the first.
        seed: seed of the drive.
        nominal: the nominal crane of the ranges.
        progress: see ``Progress``.

    Raises:
        DriveError: a deployment does not fit the drive.
    """
    ranges = deployments[0].deployment.config.uncertainty
    runs = [Named(RAW, deployments[0].deployment), *deployments]
    playback: Playback | None = None
    for k, one in enumerate(runs):
        drawn = draw_drive(one.deployment, seed, ranges, nominal)
        options = drawn.options
        driven = driven_part(one.deployment, options.get("crane"))
        if playback is None:
            fault = f", {drawn.fault}" if drawn.fault else ""
            crane = options.get("parameters") or nominal
            playback = Playback(f"drive {seed}: {drawn.operator}{fault}", list(driven.axes), crane)
            shown = ", ".join(f"{name} {value:.3g}" for name, value in drawn.factors.items())
            playback.notes.append(f"drawn: {shown}")
        film = CraneFilm(one.name, driven)
        options["bypass"] = k == 0
        simulation = Simulation(one.deployment, drawn.script, film.receive, **options)
        for time_ms in simulation.ticks():
            film.advance(time_ms / 1000.0)
            progress((k + time_ms / 1000.0 / drawn.script.duration_s) / len(runs))
        playback.films.append(film)
    assert playback is not None
    # The raw one stands behind the shaped one, as on the live page.
    playback.films.append(playback.films.pop(0))
    return playback
