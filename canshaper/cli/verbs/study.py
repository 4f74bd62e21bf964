"""``canshaper study``: people place the grapple on targets, blind to the setting."""

import contextlib
import re
import signal
import tempfile
from datetime import datetime
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from canshaper.cli.common import CHANNEL, INTERFACE, SET, loader
from canshaper.errors import UsageError
from canshaper.shipped import deployment_path

if TYPE_CHECKING:
    from canshaper.machine.deployment import Deployment
    from canshaper.studio.study import Key, Table

GROUP = "design"

_RAW = "raw"
# At the start the grapple is near the ground, in the middle of the reach.
_START = ("start_radius_m=5", "start_height_m=2.2")
_REACH_M = 2.0, 8.0  # radius at the start from which every target is in reach
_LEAST = 3  # fewest persons for a bootstrap
_CODE = re.compile(r"[A-Za-z0-9_-]{1,12}")


def study(
    file: str = typer.Argument(
        "forwarder-robust.yaml", help="Deployment file; by default a shipped one."
    ),
    other: str = typer.Option(
        "forwarder-gff.yaml", "--with", metavar="FILE", help="Deployment of the third setting."
    ),
    person: str | None = typer.Option(
        None, "--person", metavar="CODE", help="Code of the person: letters and digits, no name."
    ),
    folder: Path = typer.Option(
        Path("study"), "--folder", help="Folder of the study, with key and tables."
    ),
    placements: int = typer.Option(
        18, "--placements", min=9, help="Placements of each setting that count."
    ),
    practice: int = typer.Option(9, "--practice", min=0, help="Practice placements before them."),
    pause_s: float = typer.Option(60.0, "--break", min=0.0, help="Break between two settings, s."),
    bus: bool = typer.Option(
        False, "--bus", help="Use the real joysticks on the file's buses; it only listens."
    ),
    grip: str | None = typer.Option(
        None,
        "--grip",
        metavar="MESSAGE.SIGNAL",
        help="Button of the joysticks that grips; else that of the page.",
    ),
    interface: str | None = INTERFACE,
    channel: list[str] | None = CHANNEL,
    port: int = typer.Option(8377, "--port", help="Port to serve at; 0 takes a free one."),
    unseal: bool = typer.Option(
        False, "--unseal", help="Reveal which setting is which, after the last person."
    ),
    changes: list[str] | None = SET,
) -> None:
    """Let a person place the grapple of a simulated crane on targets, not knowing the setting.

    There are three settings: raw, the file, and another file. Each has a part of its own; a Latin
    square over the persons orders them. Each finished placement is a row of FOLDER/CODE.csv. The
    same command continues a study that was interrupted. Without --person it evaluates the persons
    who are complete: changes between pairs of settings by the bootstrap, and the number of persons
    that a change needs.

    Examples:

      canshaper study --person P01

      canshaper study machine.yaml --with calmer.yaml --person P02 --bus --grip JoystickLeft.Grip

      canshaper study --folder study

      canshaper study --folder study --unseal
    """
    if person is None:
        _join(folder, unseal)
        return
    if not _CODE.fullmatch(person):
        raise UsageError(f"--person: expected 1 to 12 letters and digits, got {person[:20]!r}")
    if unseal or ((grip or interface or channel) and not bus):
        raise UsageError("--unseal: expected without --person; --grip and channels: with --bus")
    from canshaper.cli.verbs.studio import interrupt, serve
    from canshaper.studio.study import plan
    from canshaper.studio.study_results import person_page
    from canshaper.studio.study_stage import RealJoysticks, StudyStage, study_app
    from canshaper_sim.parameters import changed_parameters

    signal.signal(signal.SIGTERM, interrupt)
    with contextlib.suppress(KeyboardInterrupt), contextlib.ExitStack() as stack:
        all_changes = [*_START, *(changes or [])]
        parameters = changed_parameters(all_changes, loader(file)())
        if not _REACH_M[0] <= (start_m := parameters.start_radius_m) <= _REACH_M[1]:
            raise UsageError(f"--set start_radius_m: expected 2 .. 8 m, got {start_m:g}")
        task = {"placements": placements, "practice": practice, "break": pause_s}
        key = _key(folder, file, other, task | {"crane": all_changes})
        copies = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        settings = _settings(key, file, other, copies)
        table, result = _table(folder, person, key), folder / f"{person}.html"
        joysticks = RealJoysticks(loader(file, interface, channel)(), grip) if bus else None
        if joysticks:
            stack.callback(joysticks.close)

        def write() -> None:
            result.write_text(person_page(person, table.rows), encoding="utf-8")

        stack.callback(write)
        counts, seed = (practice, placements), f"{key.seed} {person}"
        planned = plan(counts, start_m, table.common["order"], seed)
        stage = StudyStage(
            settings, planned, pause_s, table, parameters=parameters, changes=all_changes,
            joysticks=joysticks, done=write,
        )  # fmt: skip
        serve(stack, "127.0.0.1", port, partial(study_app, stage, parameters, result), stage)


def _key(folder: Path, file: str, other: str, about: dict[str, Any]) -> "Key":
    """Return the key of the study, which says what each letter stands for; make a missing one.

    ``about`` are the parameters of the task. Files that cannot be compared are a UsageError, as is
    a key of other settings or of another task.
    """
    from canshaper.studio.study import KEY, Key
    from canshaper_sim.parameters import changed_parameters

    paths = {Path(name).name: deployment_path(name) for name in (file, other)}
    if len(paths) < 2:
        raise UsageError(f"--with: expected another file than {file}")
    files = [loader(str(path))() for path in paths.values()]
    inputs = [(list(one.axes), [j.key for j in one.joysticks.values()]) for one in files]
    if inputs[0] != inputs[1]:
        raise UsageError(f"--with: expected axes and joysticks of {file}, got those of {other}")
    if changed_parameters([], files[0]) != changed_parameters([], files[1]):
        raise UsageError(f"--with: expected the crane.simulated of {file}, got that of {other}")
    if not any(axis.status for axis in files[0].axes.values()):
        raise UsageError(f"{file}: expected status messages, which say when the crane moves")
    folder.mkdir(parents=True, exist_ok=True)
    hashes = {name: sha256(path.read_bytes()).hexdigest()[:16] for name, path in paths.items()}
    return Key(folder / KEY, {_RAW: hashes[Path(file).name], **hashes}, about)


def _settings(key: "Key", file: str, other: str, copies: Path) -> "dict[str, Deployment]":
    """Return the deployment of each letter of the key; that of raw is ``file`` without filters."""
    from canshaper.studio.study_stage import setting

    by_name = {_RAW: setting(deployment_path(file), copies, raw=True)}
    by_name |= {Path(one).name: setting(deployment_path(one), copies) for one in (file, other)}
    return {letter: by_name[name] for letter, name in key.letters.items()}


def _table(folder: Path, person: str, key: "Key") -> "Table":
    """Return the table of a person; a new person gets the next order of the settings."""
    from canshaper.studio.study import ORDERS, Table, rows_of

    table = Table(folder / f"{person}.csv", {"study": key.mark, "person": person})
    before = sum(bool(rows_of(path, key.mark)) for path in folder.glob("*.csv"))
    table.common["order"] = ORDERS[before % len(ORDERS)]
    if table.rows:
        table.common["order"] = table.rows[0]["order"]
    return table


def _join(folder: Path, unseal: bool) -> None:
    """Print the results of all complete persons, and how many persons a change needs.

    The results, of three persons or more, are also in study.html. ``unseal`` names the settings,
    and keeps in study.opened when it first did.
    """
    from canshaper.cli.results import Results
    from canshaper.studio import study_results as results
    from canshaper.studio.study import KEY, LETTERS, mark_of, read_key

    shown, spread = Results("Study", None, None), results.SPREAD
    if (folder / KEY).exists():
        key, opened = read_key(folder / KEY), folder / "study.opened"
        persons, others = results.complete(folder, mark_of(folder / KEY), key["task"]["placements"])
        if unseal and not opened.exists():
            opened.write_text(f"{datetime.now().astimezone():%Y-%m-%d %H:%M}\n", encoding="utf-8")
        shown = Results("Study", None, folder / "study.html")
        shown.print(f"complete: {len(persons)} persons; not: {', '.join(others) or 'none'}")
        if opened.exists():
            shown.print(f"key opened {opened.read_text('utf-8').strip()}")
        names = key["letters"] if unseal else dict(zip(LETTERS, LETTERS, strict=True))
        if len(persons) >= _LEAST:
            shown.print(results.pairs_table(persons, names), results.PAIRS_NOTE)
            spread = max(results.spreads(persons))
    shown.print(results.power_table(spread))
    shown.write()
