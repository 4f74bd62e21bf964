"""Let operators practise and work, with and without anti-sway; table and picture of the results."""

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from statistics import fmean, median
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from rich.table import Table
from rich.text import Text
from scipy import stats

from canshaper.campaign.engine import Engine
from canshaper.campaign.run import Source
from canshaper.campaign.statistics import CONFIDENCE
from canshaper.campaign.work import LIMIT_S, LOADS, Move, SetUp, Work, do_work, learn
from canshaper.inputs.value import OWN
from canshaper.report.console import OnProgress, new_table
from canshaper_sim.operator_model import Operators, Skill
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.recorder import Recorder
from canshaper_sim.recording import CraneTrace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Techniques that an operator tries in practice, and the number of working cycles for each.
_SPEEDS, _CATCHES, _PRACTICE = (0.25, 0.5, 0.75, 1.0), (0.0, 0.5, 1.0), 2
Done = dict[Work, list[Move]]
"""The moves of each working cycle."""
Doing = Callable[[Sequence[Work]], Done]
"""A function that does working cycles."""


class Task(NamedTuple):
    """A tolerance, and the operator who works to it.

    Attributes:
        operator: name of the model of the operator.
        within: distance of the tip from its target, m, and swing, degrees; infinite: any.
    """

    operator: str
    within: tuple[float, float]

    @property
    def head(self) -> str:
        """Head of the column of the task, in two lines."""
        tip_m, most_deg = self.within
        swing = "tip only" if most_deg == math.inf else f"{most_deg:g} deg"
        return f"{100.0 * tip_m:g} cm\n{swing}"

    @property
    def words(self) -> str:
        """The tolerance in a line."""
        return self.head.replace("\n", ", ")


# Tasks by the profile that suits them.
TASKS = {
    "precise": Task("waiting", (0.30, 2.0)),
    "loading": Task("catching", (0.30, 6.0)),
    "rough": Task("catching", (0.60, 20.0)),
    "tip only": Task("catching", (0.30, math.inf)),
}
OFF = SetUp("off", bypass=True)


def practised(
    source: Source,
    set_ups: Sequence[SetUp],
    people: Mapping[str, Skill],
    within: tuple[float, float],
    do: Doing,
    *,
    cycles: int = _PRACTICE,
) -> list[Work]:
    """Let each operator practise with each set-up; return works with the fastest techniques.

    Args:
        people: skills by operator.
        within: tolerance: tip from the target, m, and swing, degrees.
        do: does the working cycles.
        cycles: working cycles of practice with each technique.

    Raises:
        CampaignError: see ``learn``.
    """
    known = {one: learn(source, one) for one in set_ups}
    works = [
        Work(set_up, name, skill, known[set_up], (), within, "")
        for set_up, (name, skill) in product(set_ups, people.items())
    ]
    trials = [
        replace(one, techniques=(way,) * len(LOADS), seed=f"practice {number}")
        for one, way, number in product(works, product(_SPEEDS, _CATCHES), range(cycles))
        if way[1] <= (one.skill.catch if within[1] < math.inf else 0.0)  # else nothing is caught
    ]
    tried = defaultdict[Any, list[float]](list)
    for one, moves in do(trials).items():
        for move in moves:
            plan = replace(one, techniques=(), seed="")
            tried[plan, move.load, one.techniques[0]].append(move.seconds)
    order = sorted(tried, key=lambda key: fmean(tried[key]), reverse=True)
    best = {key[:2]: key[2] for key in order}  # the fastest comes last
    return [replace(one, techniques=tuple(best[one, load] for load in LOADS)) for one in works]


def do_all(
    engine: Engine,
    source: Source,
    progress: OnProgress,
    works: Sequence[Work],
    done: Done | None = None,
) -> Done:
    """Do all works; return them in this order. ``done`` gets each when it is done, in any order."""
    done = {} if done is None else done
    for work, moves in engine.run(partial(do_work, source), works):
        done[work] = moves
        progress(len(done) / len(works))
    return {work: done[work] for work in works}


def at_work(
    engine: Engine,
    source: Source,
    set_ups: Sequence[SetUp],
    tasks: Mapping[str, Task],
    progress: OnProgress,
    *,
    seeds: int,
) -> tuple[dict[str, dict[SetUp, list[Move]]], str]:
    """Practise for one cycle and do each task, with each set-up.

    Args:
        progress: called with the part that is done, 0 to 1, and the name of the work.
        seeds: number of working cycles of each task with each set-up.

    Returns:
        The moves, by task and set-up, and "". After Ctrl-C: the moves of the working cycles that
        every set-up has done, and a text that says how many these are.

    Raises:
        CampaignError: see ``learn``.
    """
    by_task: dict[str, dict[SetUp, list[Move]]] = {}
    for name, task in tasks.items():
        interrupted, done = False, Done()
        people = {task.operator: getattr(Operators(), task.operator)}
        do = partial(do_all, engine, source, progress)
        try:
            progress(0.0, f"{task.words}: practice")
            plans = practised(source, set_ups, people, task.within, do, cycles=1)
            progress(0.0, f"{task.words}: work")
            do([replace(one, seed=str(seed)) for seed in range(seeds) for one in plans], done)
        except KeyboardInterrupt:
            interrupted = True
        cycles = Counter(work.seed for work in done)
        whole = [seed for seed, count in cycles.items() if count == len(set_ups)]
        if whole:
            by_task[name] = {one: [] for one in set_ups}
        for work, moves in done.items():
            if work.seed in whole:
                by_task[name][work.set_up] += moves
        if interrupted:
            return by_task, f"{task.words}: {len(whole)} of {seeds} working cycles are done"
    return by_task, ""


def choice(
    title: str, tasks: Mapping[str, Task], moves: Mapping[str, Mapping[SetUp, Sequence[Move]]]
) -> tuple[Table, list[str]]:
    """Return the table of seconds a move, empty / log, by set-up (row) and task (column).

    A cell slower than ``OFF`` is red. Also return a text for each such cell.
    """
    drawn = new_table(title, *(tasks[name].head for name in moves))
    slower = []
    for one in next(iter(moves.values()), {}):
        cells = []
        for name, done in moves.items():
            means = {load: _seconds(done[one], load) for load in LOADS}
            more_s = _seconds(done[one]) - _seconds(done[OFF])
            style = "red" if more_s > 0.0 else "bold" if name == (one.name or "loading") else ""
            cells.append(Text(" / ".join(f"{mean:.1f}" for mean in means.values()), style))
            if more_s > 0.0:
                at = tasks[name].words
                slower.append(f"{set_up_name(one)}: {more_s:.1f} s a move slower than off at {at}")
        drawn.add_row(set_up_name(one), *cells)
    return drawn, slower


def set_up_name(one: SetUp) -> str:
    """Return the name of a set-up in a table."""
    return one.name or OWN


def as_data(moves: Mapping[str, Mapping[SetUp, Sequence[Move]]]) -> dict[str, Any]:
    """Return seconds a move by task, set-up and load, for ``--json``."""
    return {
        name: {
            set_up_name(one): {load: _seconds(done, load) for load in LOADS}
            for one, done in by_set_up.items()
        }
        for name, by_set_up in moves.items()
    }


def _seconds(moves: Sequence[Move], load: str | None = None) -> float:
    return fmean(move.seconds for move in moves if load in (None, move.load))


def gain(raw: Sequence[float], shaped: Sequence[float]) -> tuple[float, float, float]:
    """Return (change of the mean, its low and high 95 % bound), %, by the bootstrap over pairs."""

    def change(a: Any, b: Any, axis: int = -1) -> Any:
        return 100.0 * (np.mean(b, axis) / np.mean(a, axis) - 1.0)

    pairs, source = (raw, shaped), np.random.default_rng(0)
    options: dict[str, Any] = {"method": "percentile", "random_state": source}
    result = stats.bootstrap(pairs, change, paired=True, confidence_level=CONFIDENCE, **options)
    bounds = result.confidence_interval
    return float(change(raw, shaped)), float(bounds.low), float(bounds.high)


_MEASURES: Sequence[tuple[str, str, Callable[[Move], float], Callable[..., float]]] = (
    (f"in {LIMIT_S:g} s\n%", ".0f", lambda move: 100.0 * move.done, fmean),
    ("taps\n", ".1f", lambda move: move.taps, fmean),
    ("waits\ns", ".1f", lambda move: move.waiting_s, fmean),
    ("peak\ndeg", ".0f", lambda move: move.peak_deg, median),
    ("beyond\nm", ".2f", lambda move: move.beyond_m, fmean),
)


def table(done: Done) -> Table:
    """Return the table: a row for each operator and load, each measure with anti-sway off / on."""
    heads = "seconds\n", "change, %\n95 %", *(head for head, *_ in _MEASURES)
    drawn = new_table("a move, off / on", *heads)
    for name, load in product(dict.fromkeys(one.operator for one in done), LOADS):
        pair = [
            [
                [move for move in moves if move.load == load]
                for one, moves in done.items()
                if (one.set_up.bypass, one.operator) == (bypass, name)
            ]
            for bypass in (True, False)
        ]
        means = [[fmean(move.seconds for move in moves) for moves in cycles] for cycles in pair]
        change, low, high = gain(*means)
        cells = [" / ".join(f"{fmean(one):.1f}" for one in means)]
        cells.append(f"{change:+.0f} ({low:+.0f}..{high:+.0f})")
        for _, style, measure, mean in _MEASURES:
            figures = (mean(measure(move) for moves in one for move in moves) for one in pair)
            cells.append(" / ".join(f"{figure:{style}}" for figure in figures))
        drawn.add_row(f"{name}, {load}", *cells)
    return drawn


def figure(source: Source, works: Sequence[Work]) -> "Figure":
    """Return the picture of the first two moves of two works, anti-sway off and on."""
    from canshaper.report import style  # noqa: PLC0415  (an extra)
    from canshaper.report.style import draw_top_views  # noqa: PLC0415  (the same)

    fig = style.new_figure(style.WIDTH_PX, 1200, dpi=style.PRINT_DPI)
    drives: list[tuple[CraneTrace, Sequence[range]]] = []
    panel = fig.add_axes((0.45, 0.16, 0.53, 0.76))
    for work, colour in zip(works, (style.RAW_COLOUR, style.SHAPED_COLOUR), strict=True):
        deployment = source.load()
        recorder = Recorder(deployment, changed_parameters([*source.changes], deployment))
        do_work(source, work, recorder.receive, 2)
        recording = recorder.recording()
        if crane := recording.crane:
            drives.append((crane, ()))
            panel.plot(recording.t_s, crane.sway_deg, color=colour)
    style.plain(panel, size=style.TEXT_PT)
    style.titled(panel, "Swing, deg, over s: empty out, log back", style.TITLE_PT)
    sizes = style.TEXT_PT, style.TITLE_PT
    draw_top_views(fig, drives, (0.05, 0.16, 0.38, 0.92), sizes=sizes)
    return fig
