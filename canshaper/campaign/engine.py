"""Work on a Dask cluster or in Slurm jobs, with the same results as in processes of this machine.

Each job yields one result. A worker that dies costs time, but no result: another worker does its
job again.
"""

import signal
import subprocess
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, Protocol, TypeVar

from canshaper.errors import CampaignError, WorkerError
from canshaper.machine.identity import program_sha256

# A scheduler answers at once or is absent; a batch system may start its workers later.
CONNECT_S, WORKERS_S = 10.0, 60.0

J = TypeVar("J")
R = TypeVar("R")


class Engine(Protocol):
    """Where work is done."""

    def run(self, work: Callable[[J], R], jobs: Iterable[J]) -> Iterator[tuple[J, R]]:
        """Do every job; yield each job with its result, in any order.

        Args:
            work: does one job; a function of a module, or a ``functools.partial`` of one.
            jobs: read one by one, a few ahead of those that are done.

        Raises:
            CampaignError: a job kills its workers, or the cluster does not answer.
        """


@dataclass
class Cluster:
    """Workers of a Dask scheduler.

    Attributes:
        scheduler: its address, such as tcp://10.0.0.1:8786.
        on_refusal: called with the reason why a worker gets no more jobs.
        workers_s: time to wait for the first worker; None for no limit.
    """

    scheduler: str
    on_refusal: Callable[[str], object] = field(default=lambda _text: None)
    workers_s: float | None = WORKERS_S

    def __post_init__(self) -> None:
        """Check the address here: a client with a wrong one takes half a minute to end.

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
                """Keep four jobs for each core under way; one job where all workers are gone."""
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
    """Slurm jobs, each one a worker of a Dask scheduler in this process.

    The user's Dask configuration gives queue, account, cores and memory of a job; without it a job
    has one core.

    Attributes:
        count: number of Slurm jobs.
        on_refusal: see ``Cluster``.
    """

    count: int
    on_refusal: Callable[[str], object] = field(default=lambda _text: None)

    def run(self, work: Callable[[J], R], jobs: Iterable[J]) -> Iterator[tuple[J, R]]:
        """Do every job; see ``Engine``. The first one waits until Slurm has started a worker."""
        import dask  # noqa: PLC0415  (an extra)

        ctrl_c = signal.getsignal(signal.SIGINT)
        from dask_jobqueue import SLURMCluster  # noqa: PLC0415  (the same)

        signal.signal(signal.SIGINT, ctrl_c)  # the import replaces Ctrl-C by an exit with status 0
        given = dask.config.get("jobqueue.slurm")
        defaults = {"cores": 1, "memory": "1 GB", "log_directory": "out/slurm"}
        options = {name: given[name.replace("_", "-")] or one for name, one in defaults.items()}
        page = given["scheduler-options"] | {"dashboard": False, "dashboard_address": ":0"}
        with SLURMCluster(**options, scheduler_options=page) as slurm:
            _try_job(slurm.job_script())
            # Unlike `scale` it replaces a job that ends, for example at its time limit.
            slurm.adapt(minimum_jobs=self.count, maximum_jobs=self.count)
            workers = Cluster(slurm.scheduler_address, self.on_refusal, None)
            yield from workers.run(work, jobs)


def _try_job(script: str) -> None:
    """Ask Slurm whether it accepts the job script: a later refusal would be in a log only.

    Raises:
        CampaignError: it does not, or this machine has no sbatch.
    """
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
    """Return the options of a job that keep it away from refused workers.

    Raises:
        CampaignError: every worker was refused.
    """
    if not refused:
        return {}
    workers = [address for address in client.ncores() if address not in refused]
    if not workers:
        raise CampaignError("every worker has another version than this program")
    return {"workers": workers, "allow_other_workers": False}


def _checked(program: str, work: Callable[[J], R], job: J) -> R:
    """Do a job in a worker that runs the same program.

    Raises:
        WorkerError: the worker runs another version.
    """
    if (own := program_sha256()) != program:
        from distributed import get_worker  # noqa: PLC0415  (an extra)

        text = f"expected the program sha256:{program[:12]}, got sha256:{own[:12]}"
        raise WorkerError(get_worker().address, text)
    return work(job)
