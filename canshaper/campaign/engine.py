"""Work on a Dask cluster or in jobs of Slurm, with the results of this machine's processes.

Every piece is done once, and its result handed out once, whatever becomes of the process that had
it: one that dies costs time, no result.
"""

import signal
import subprocess
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, Protocol, TypeVar

from canshaper.errors import CampaignError, WorkerError
from canshaper.machine.identity import program_sha256

# A scheduler answers at once, or is not there; workers of a batch system may start later.
CONNECT_S, WORKERS_S = 10.0, 60.0

J = TypeVar("J")
R = TypeVar("R")


class Engine(Protocol):
    """Where work is done."""

    def run(self, work: Callable[[J], R], jobs: Iterable[J]) -> Iterator[tuple[J, R]]:
        """Do every job; each with its result, in any order.

        Args:
            work: what to do; a function of a module, or ``functools.partial`` of one.
            jobs: taken one by one, a few more than are being done.

        Raises:
            CampaignError: the processes die of it, or the cluster is gone.
        """


@dataclass
class Cluster:
    """Workers of a Dask scheduler.

    Attributes:
        scheduler: its address, such as tcp://10.0.0.1:8786.
        on_refusal: called with what is wrong with a worker that is given nothing more.
        workers_s: how long to wait for the first worker; None for ever.
    """

    scheduler: str
    on_refusal: Callable[[str], object] = field(default=lambda _text: None)
    workers_s: float | None = WORKERS_S

    def __post_init__(self) -> None:
        """Check the address; a client that has begun with a wrong one takes half a minute to end.

        Raises:
            CampaignError: ``scheduler`` is no address.
        """
        from distributed.comm import get_address_host_port  # noqa: PLC0415  (an extra)

        try:
            get_address_host_port(self.scheduler, strict=True)
        except ValueError:
            expected = "expected the address of a scheduler, such as tcp://10.0.0.1:8786"
            raise CampaignError(f"{self.scheduler}: {expected}") from None

    def run(self, work: Callable[[J], R], jobs: Iterable[J]) -> Iterator[tuple[J, R]]:
        """Do every job; see ``Engine``."""
        from distributed import Client, KilledWorker, as_completed  # noqa: PLC0415  (an extra)

        try:
            client: Any = Client(self.scheduler, timeout=CONNECT_S, set_as_default=False)
        except OSError as error:
            text = str(error).splitlines()[0]
            raise CampaignError(f"{self.scheduler}: no scheduler answers: {text}") from None
        refused: set[str] = set()
        with client:
            try:
                client.wait_for_workers(1, timeout=self.workers_s)
            except TimeoutError:
                text = f"{self.scheduler}: expected workers, got none within {self.workers_s:g} s"
                raise CampaignError(text) from None
            waiting = iter(jobs)
            doing: dict[Any, J] = {}
            done: Any = as_completed(loop=client.loop)

            def submit(job: J) -> None:
                future = client.submit(
                    _checked, program_sha256(), work, job, pure=False, **_others(client, refused)
                )
                doing[future.key] = job
                done.add(future)

            def fill() -> None:
                """Give every core four jobs; workers come and go, one job is always under way."""
                most = max(1, 4 * sum(client.ncores().values()))
                for job in islice(waiting, max(0, most - len(doing))):
                    submit(job)

            fill()
            for future in done:
                job = doing.pop(future.key)
                try:
                    result = future.result()
                except WorkerError as error:
                    if error.worker not in refused:
                        self.on_refusal(str(error))
                        refused.add(error.worker)
                    submit(job)
                    continue
                except KilledWorker:
                    raise CampaignError(f"{self.scheduler}: the workers died of {job}") from None
                yield job, result
                fill()


@dataclass
class Slurm:
    """Jobs of Slurm, each a worker of a Dask scheduler in this process.

    Queue, account, cores and memory of a job are those of the user's Dask configuration; without
    one a job has one core.

    Attributes:
        count: how many jobs.
        on_refusal: see ``Cluster``.
    """

    count: int
    on_refusal: Callable[[str], object] = field(default=lambda _text: None)

    def run(self, work: Callable[[J], R], jobs: Iterable[J]) -> Iterator[tuple[J, R]]:
        """Do every job; see ``Engine``. It waits until Slurm has begun one of its own."""
        import dask  # noqa: PLC0415  (an extra)

        ctrl_c = signal.getsignal(signal.SIGINT)
        from dask_jobqueue import SLURMCluster  # noqa: PLC0415  (the same)

        signal.signal(signal.SIGINT, ctrl_c)  # the import makes it an exit with status 0
        given = dask.config.get("jobqueue.slurm")
        defaults = {"cores": 1, "memory": "1 GB", "log_directory": "out/slurm"}
        options = {name: given[name.replace("_", "-")] or one for name, one in defaults.items()}
        page = given["scheduler-options"] | {"dashboard": False, "dashboard_address": ":0"}
        with SLURMCluster(**options, scheduler_options=page) as slurm:
            _try_job(slurm.job_script())
            # Unlike `scale` it replaces a job that ends, at its time limit or otherwise.
            slurm.adapt(minimum_jobs=self.count, maximum_jobs=self.count)
            workers = Cluster(slurm.scheduler_address, self.on_refusal, None)
            yield from workers.run(work, jobs)


def _try_job(script: str) -> None:
    """Let Slurm say whether it would take a job; afterwards its answer is in a log only."""
    try:
        done = subprocess.run(
            ["sbatch", "--test-only"], input=script, capture_output=True, text=True, check=False
        )
    except OSError as error:
        text = f"slurm: expected the command sbatch on this machine: {error}"
        raise CampaignError(text) from None
    if done.returncode:
        raise CampaignError(f"slurm: {' '.join(done.stderr.split())}")


def _others(client: Any, refused: set[str]) -> dict[str, Any]:
    """Where a job may run: anywhere, until a worker was refused."""
    if not refused:
        return {}
    workers = [address for address in client.ncores() if address not in refused]
    if not workers:
        raise CampaignError("every worker has another version than this program")
    return {"workers": workers, "allow_other_workers": False}


def _checked(program: str, work: Callable[[J], R], job: J) -> R:
    """Do a job in a worker, if it runs the same program."""
    if (own := program_sha256()) != program:
        from distributed import get_worker  # noqa: PLC0415  (an extra)

        text = f"expected the program sha256:{program[:12]}, got sha256:{own[:12]}"
        raise WorkerError(get_worker().address, text)
    return work(job)
