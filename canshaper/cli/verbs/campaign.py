"""``canshaper campaign``: many drives, drawn from the uncertainty of a machine."""

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from canshaper.cli.common import (
    EXIT_INTERRUPTED,
    PLANT,
    PROCESSES,
    REPORT,
    SCHEDULER,
    SET,
    echo,
    engine,
    loader,
    os_errors,
)
from canshaper.errors import ConfigError, UsageError

if TYPE_CHECKING:
    from canshaper.campaign.engine import Engine
    from canshaper.campaign.run import Source
    from canshaper.campaign.store import Store
    from canshaper.cli.results import Results
    from canshaper.machine.deployment import Deployment

GROUP = "design"

EXIT_NOT_ACCEPTED = 1


def campaign(
    file: str = typer.Argument(
        "forwarder-robust.yaml", help="Deployment file; by default a shipped one."
    ),
    drives: int = typer.Option(1000, "--drives", "-n", min=1, help="Number of drives."),
    first: int = typer.Option(0, "--first", min=0, help="Seed of the first drive."),
    against: str | None = typer.Option(
        None, "--against", metavar="FILE", help="Compare with this deployment, on the same drives."
    ),
    out: Path = typer.Option(Path("out/campaign"), "--out", help="Folder for the drives."),
    resume: bool = typer.Option(False, "--resume", help="Continue the campaign in the folder."),
    processes: int | None = PROCESSES,
    scheduler: str | None = SCHEDULER,
    cluster: Literal["slurm"] | None = typer.Option(
        None, "--cluster", help="Run as jobs of this batch system, as many as --processes."
    ),
    shard: str | None = typer.Option(
        None, "--shard", metavar="I/N", help="Drive only the I-th of N shares."
    ),
    merge: list[Path] | None = typer.Option(
        None,
        "--merge",
        metavar="FOLDER",
        help="Drive nothing; add the drives of this folder; repeatable.",
    ),
    native: Literal["native", "python"] | None = typer.Option(
        None, "--engine", help="Engine of the drives; by default native (C) if there is a compiler."
    ),
    plant: Path | None = PLANT,
    changes: list[str] | None = SET,
    report: Path | None = REPORT,
) -> None:
    """Drive the real controller on many simulated cranes, and say how sure the result is.

    Each drive draws tool, load, radius, valves, operator and faults from its seed and the ranges
    in the file's "uncertainty" section. Quantiles have bounds that hold with 95 % confidence. The
    folder gets one Parquet row a drive; Ctrl-C keeps the finished drives. `canshaper demo FILE
    --seed SEED` shows a drive. With --plant the crane is not drawn, only operators and faults, and
    there is only one process.

    Exit code 1 when a promise was broken, or the drives do not prove that a limit of the file's
    "accept" section is kept.

    Examples:

      canshaper campaign machine.yaml

      canshaper campaign machine.yaml -n 100000 --resume --out out/night

      canshaper campaign old.yaml --against new.yaml -n 2000

      canshaper campaign machine.yaml --scheduler tcp://10.0.0.1:8786

      canshaper campaign machine.yaml --cluster slurm --processes 40

      canshaper campaign machine.yaml --shard 3/20 --out share3

      canshaper campaign machine.yaml --merge share1 --merge share2
    """
    from canshaper.campaign.draw import check_same_axes
    from canshaper.campaign.run import Source, shard_of
    from canshaper.campaign.store import Store
    from canshaper.cli.results import Results
    from canshaper.native.library import has_compiler
    from canshaper_sim.parameters import changed_parameters
    from canshaper_sim.recorder import dwell_s

    deployment = loader(file)()
    changed_parameters(changes or [], deployment)  # a wrong one is reported before the work
    seeds = shard_of(range(first, first + drives), shard)
    files = [deployment, *([loader(against)()] if against else [])]
    check_same_axes(files[0], files[-1])
    if plant:
        if scheduler or cluster or native == "native" or (processes or 1) > 1:
            others = "--processes, --scheduler, --cluster or --engine native"
            raise UsageError(f"--plant: expected one process of Python, without {others}")
        native, processes = "python", 1
        echo(f"engine: python, in one process: the crane is {plant}", err=True)
    results = Results("Campaign", deployment, report)
    ranges = deployment.config.uncertainty
    engine_name = native or ("native" if has_compiler() else "python")
    longest_s = max(map(dwell_s, files))
    about = ranges, changes or [], engine_name, longest_s
    sources = [replace(Source.of(one, *about), unit=plant) for one in files]
    stores = [
        Store(out / f"{'ab'[k]}-{one.path.stem}" if against else out, source.about)
        for k, (one, source) in enumerate(zip(files, sources, strict=True))
    ]
    interrupted = False
    workers = engine(processes, scheduler, cluster)
    if merge:
        for store in stores:
            for folder in merge:
                place = folder / store.folder.relative_to(out)
                echo(f"{place}: {store.merge(place)} new drives", err=True)
    else:
        kept = sum(len(store.seeds) for store in stores)
        if kept and not resume:
            text = f"--out: expected a folder without drives, or --resume; {out} has {kept}"
            raise UsageError(text)
        if engine_name == "python" and not native:
            echo("engine: python, for want of a C compiler", err=True)
        for source in sources:  # compile it and compare it with Python before the work
            if isinstance(why := source.native(), ConfigError):
                echo(f"driven by Python: {why}", err=True)
        interrupted = _drive(workers, sources, seeds, stores)
    accepted = _report(files, stores, results)
    results.write()
    if interrupted:
        echo("interrupted; what is done is kept, --resume goes on", err=True)
        raise typer.Exit(EXIT_INTERRUPTED)
    if not accepted:
        raise typer.Exit(EXIT_NOT_ACCEPTED)


def _drive(workers: "Engine", sources: "list[Source]", seeds: range, stores: "list[Store]") -> bool:
    """Drive the seeds with every file; return whether Ctrl-C interrupted them."""
    from canshaper.campaign.run import run_campaign
    from canshaper.report.console import progress_bar

    for source, store in zip(sources, stores, strict=True):
        with progress_bar(Path(source.path).name, len(seeds)) as on_progress:
            try:
                run_campaign(workers, source, seeds, store, on_progress)
            except KeyboardInterrupt:
                return True
    return False


def _report(files: "list[Deployment]", stores: "list[Store]", results: "Results") -> bool:
    """Print and write the results; return whether the first file's limits accept them all.

    A file without a drive ends it, and is not accepted.
    """
    from canshaper.campaign.statistics import differences
    from canshaper.campaign.summary import difference_table, lines, summarise, tables

    accept = files[0].config.accept.model_dump(exclude_none=True)
    columns, accepted = [store.columns() for store in stores], True
    for one, store, of_file in zip(files, stores, columns, strict=True):
        if not of_file:
            return False
        summary = summarise(of_file, accept)
        accepted = accepted and summary.accepted
        results.print(f"{one.path.name}: {len(of_file['seed'])} drives in {store.folder}")
        for table in tables(summary):
            results.print(table)
        for line in lines(summary):
            results.print(line)
        path = store.folder / "_summary.json"
        with os_errors(path):
            path.write_text(json.dumps(summary.as_dict(), indent=2) + "\n", encoding="utf-8")
    if len(files) == 2:
        results.print(difference_table(differences(*columns)))
    return accepted
