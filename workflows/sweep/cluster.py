"""Tasks of a sweep on the processes of a Dask cluster: of this machine, or by an address.

Dask sends the tasks of a lost worker to another one; a task that ends several workers fails, and
its cases are rows with that message.
"""

from asyncio import run as run_loop
from asyncio import wait_for
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from logging import getLogger
from os import cpu_count
from re import fullmatch
from time import perf_counter
from typing import Any

from beadwave.system import adding
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.sweep.core.case_row import FAILED, Rows, without_result
from beadwave.workflows.sweep.marched_group import rows
from beadwave.workflows.sweep.models import SharedWall, models, shared_wall
from beadwave.workflows.sweep.tasks import Sharing, Task

HERE = "127.0.0.1"
PATIENCE = "10s"  # to reach a scheduler
# scheme (tcp without one), host, an IPv6 one in brackets, and port; inproc is of this process
ADDRESS = r"((tcp|tls|ws|wss|ucx)://)?(\[[\da-fA-F:]+\]|[^\s:/\[\]]+):\d{1,5}|inproc://.+"


# Distribution of tasks over a cluster
N_RETRIES = 2  # of a task whose worker ended
MAX_PER_CORE = 64  # processes of this machine, each a third of a gigabyte
RECOUNT_SECONDS = 1.0  # s between counts of the workers, each as long as the list of workers
TASKS_AHEAD = 4  # tasks for each thread that are handed over before the first is done


def require_processes(where: int | str) -> None:
    """Raise InvalidScene for no process at all, and for more than this machine can start."""
    allowed = MAX_PER_CORE * (cpu_count() or 1)
    if isinstance(where, int) and not 1 <= where <= allowed:
        raise InvalidScene(
            f"{where} processes; give 1 to {allowed} on this machine, or a scheduler's address."
        )


@contextmanager
def engine(where: int | str) -> Iterator[Callable]:
    """A function that computes tasks on `where` processes of this machine, or on the cluster of a
    scheduler at that address.

    Raises InvalidScene for numbers of processes that cannot be, where Dask is not installed, and
    where the scheduler does not answer.
    """
    require_processes(where)
    try:
        import dask

        # read by the next import: what Dask logs of lost connections are tracebacks
        dask.config.set(logging={"distributed": "critical", "distributed.client": "critical"})
        from distributed import Client, LocalCluster
    except ImportError:
        raise InvalidScene(
            "processes and clusters need dask.distributed, which is not installed; "
            f"{adding('sweep')} installs it."
        ) from None
    dask.config.set({"distributed.scheduler.allowed-failures": N_RETRIES})

    # processes of this machine
    if isinstance(where, int):
        # scheduler, workers and dashboard alone to this machine: who reaches them runs code here
        cluster = LocalCluster(
            n_workers=where, threads_per_worker=1, host=HERE, dashboard_address=f"{HERE}:0"
        )
        with cluster, Client(cluster) as client, _while_it_runs():
            yield on(client)
        return

    # a scheduler: its address is looked at, then the scheduler is asked for its identity
    if not fullmatch(ADDRESS, where):
        raise InvalidScene(
            f"--scheduler {where} is no address; give scheme, host and port of a running Dask "
            "scheduler, tcp://host:8786 for example."
        )
    try:
        with ThreadPoolExecutor(1) as aside:  # a notebook has an event loop of its own
            aside.submit(run_loop, _answer(where)).result()
        client = Client(where, timeout=PATIENCE)
    except Exception as error:  # each kind of address fails in its own way
        if isinstance(error, TypeError) and "ssl_context" in str(error):
            raise InvalidScene(
                f"--scheduler {where} needs certificates, and Dask's configuration names none; set "
                "distributed.comm.tls.ca-file, client.cert and client.key in "
                "~/.config/dask/distributed.yaml, or give a tcp:// address."
            ) from None
        raise InvalidScene(
            f"--scheduler {where} does not answer; give the address of a running Dask "
            "scheduler, tcp://host:8786 for example."
        ) from None
    if not client.nthreads():
        getLogger(__name__).warning(
            f"the scheduler at {where} has no workers: cases wait until one joins, "
            f"started by: dask worker {where}"
        )
    with client, _while_it_runs():
        yield on(client)


@contextmanager
def _while_it_runs() -> Iterator[None]:
    """Raise ValueError where the scheduler ends: a lost answer is no failed case."""
    from distributed.client import ClosedClientError

    try:
        yield
    except (CancelledError, ClosedClientError):
        raise ValueError(
            "the scheduler ended; start it again and give the same command: it goes on with the "
            "cases that are missing."
        ) from None


async def _answer(where: str) -> Any:
    """The identity of a scheduler; asked for first, since a client would wait for ever for a port
    of another program that takes connections."""
    from dask.utils import parse_timedelta
    from distributed import rpc

    async with rpc(where, timeout=PATIENCE) as scheduler:
        return await wait_for(scheduler.identity(), parse_timedelta(PATIENCE))


def on(client: Any) -> Callable[[Iterator[Sharing]], Iterator[list[Rows]]]:
    """A function that computes tasks with a Dask client: models once, then walls, then rows, each a
    future that the next one waits for."""

    def run(sharings: Iterator[Sharing]) -> Iterator[list[Rows]]:
        """Rows task by task, in the order in which tasks end."""
        from distributed import as_completed

        submit = partial(client.submit, pure=False, retries=N_RETRIES)

        # futures of models by key, and of tasks; no more tasks at once than the workers need, as a
        # scheduler keeps all that it is handed
        models_of: dict[str, Any] = {}
        running: dict[Any, Task] = {}
        completed = as_completed([])
        allowed, counted_at = _handed_over(client), perf_counter()
        for sharing in sharings:
            if sharing.key is not None and sharing.key not in models_of:
                models_of[sharing.key] = submit(models, sharing.source)
            shared = SharedWall()
            if sharing.scene is not None:
                model = models_of.get(sharing.key)
                shared = submit(shared_wall, sharing.scene, sharing.source, model)
            for task in sharing.tasks:
                future = submit(rows, task.checked, shared, task.signals)
                running[future] = task
                completed.add(future)
                while len(running) >= allowed:
                    yield _result(next(completed), running)
                    if perf_counter() > counted_at + RECOUNT_SECONDS:
                        allowed, counted_at = _handed_over(client), perf_counter()
        while running:
            yield _result(next(completed), running)

    return run


def _handed_over(client: Any) -> int:
    """Tasks to hand over to the present workers; raises CancelledError without a scheduler."""
    try:
        return TASKS_AHEAD * max(1, sum(client.nthreads().values()))
    except OSError:
        raise CancelledError from None


def _result(future: Any, running: dict[Any, Task]) -> list[Rows]:
    """Rows of a task; for a task whose workers ended, rows with that message."""
    task = running.pop(future)
    try:
        return future.result()
    except CancelledError:  # of an Exception in Dask: the scheduler is gone
        raise
    except Exception as reason:  # whatever a worker died of
        message = f"its worker ended ({type(reason).__name__}): too little memory, or it was killed"
        cases = task.checked.group.cases
        watched, across = task.checked.watched, task.checked.across
        return [without_result(watched, cases, FAILED, [message] * len(cases), across=across)]
