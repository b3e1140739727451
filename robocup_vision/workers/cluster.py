"""Workers of a dask.distributed cluster, which may come and go during a run. Needs the extra `distributed`.

What all pieces need is sent to each worker once, as a plugin, also to workers that join later. A batch whose worker
died is handed out again by the scheduler, or by `run_pieces` if the scheduler gives up on it.
"""

from __future__ import annotations

import asyncio
import time
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from typing import Any
from weakref import WeakSet

from distributed import Client, WorkerPlugin, get_worker, rpc
from distributed.scheduler import KilledWorker

from field_models.errors import ArgumentError, RobocupVisionError
from robocup_vision.workers.pieces import Pool, R, Start, Workers
from robocup_vision.workers.processes import Doer, only_one_opencv_thread

_CONNECT_S = 10.0
# within this time a cluster that restarts or starts its workers has some
_NO_WORKERS_S = 60.0
_COUNT_SLOTS_S = 2.0


def cluster_workers(address: str) -> Workers:
    """Return the workers of the cluster whose scheduler listens at an address.

    Raises
    ------
    ArgumentError
        If there is no scheduler. This is raised before any work is prepared, so a mistyped address costs no time.
    """
    _require_scheduler(address)
    return Workers(
        lambda start: _open(address, start), (BrokenExecutor, CancelledError, KilledWorker), share_files=False
    )


@contextmanager
def _open(address: str, start: Start[Any, Any]) -> Iterator[Pool]:
    with _connected(address) as client:
        watch = _WorkerWatch(client, address)
        name = f"robocup-vision-{uuid.uuid4().hex[:12]}"
        try:
            client.register_plugin(_Plugin(start, _version()), name=name)
        except ArgumentError:
            raise
        except Exception as error:
            raise ArgumentError(
                f"the workers of {address} cannot do this: {type(error).__name__}: {' '.join(str(error).split())}; "
                "each machine needs the same robocup-vision"
            ) from None
        executor = _ClusterExecutor(client)
        try:
            yield Pool(executor, partial(_do, name), watch.slots, watch.look_after)
        finally:
            # results of calls that are still running are no longer needed, and those calls need the plugin
            executor.cancel()
            with suppress(Exception):
                client.unregister_worker_plugin(name)


@contextmanager
def _connected(address: str) -> Iterator[Any]:
    # a client that fails to connect keeps trying in a thread of its own, so a plain connection is tested first
    _require_scheduler(address)
    with _connection_errors(address):
        client: Any = Client(address, timeout=_CONNECT_S, set_as_default=False)  # type: ignore[no-untyped-call]
    with client:
        yield client


def _require_scheduler(address: str) -> None:
    with _connection_errors(address):
        # in a thread, because the caller may be in an event loop
        with ThreadPoolExecutor(1) as thread:
            kind = thread.submit(asyncio.run, _kind(address)).result()
        if kind != "Scheduler":
            raise ArgumentError(f"a {kind} listens there, not a scheduler")


@contextmanager
def _connection_errors(address: str) -> Iterator[None]:
    try:
        yield
    except Exception as error:  # its type depends on what is wrong with the address
        # an OSError raised by dask says "Timed out ...", a plain TimeoutError has no text
        kind = type(error).__name__.replace("TimeoutError", "Timed out")
        reason = " ".join(str(error).split()) or kind
        raise ArgumentError(f"no dask scheduler answers at '{address}' ({reason})") from None


async def _kind(address: str) -> str:
    server: Any = rpc(address, timeout=_CONNECT_S)  # type: ignore[no-untyped-call]
    async with server:
        identity = await asyncio.wait_for(server.identity(), _CONNECT_S)
        return str(identity["type"])


class _ClusterExecutor(Executor):
    """Submits calls as dask's own `ClientExecutor` does, but survives a worker that dies after its call ended.

    dask's executor first waits for the end of a call, then reads its result. If the worker is lost in between, the
    call is pending again, which dask's executor treats as an error.
    """

    def __init__(self, client: Any) -> None:
        self._client = client
        self._calls: WeakSet[Any] = WeakSet()

    def submit(self, fn: Callable[..., R], /, *args: Any, **kwargs: Any) -> Future[R]:
        handed: Future[R] = Future()
        call = self._client.submit(fn, *args, pure=False, **kwargs)
        self._calls.add(call)
        call.add_done_callback(partial(_pass_on, handed))
        return handed

    def cancel(self) -> None:
        """Cancel the calls that have not ended."""
        self._client.cancel(list(self._calls))


def _pass_on(handed: Future[Any], call: Any) -> None:
    try:
        # if the result was lost, this waits until the call has run again
        handed.set_result(call.result())
    except BaseException as error:
        handed.set_exception(error)


class _WorkerWatch:
    """Counts the slots of the workers, and fails if there have been none for too long."""

    def __init__(self, client: Any, address: str) -> None:
        self._client, self._address = client, address
        self._slots, self._counted_s = 0, -_COUNT_SLOTS_S
        self._seen_s = time.monotonic()

    def slots(self) -> int:
        now_s = time.monotonic()
        if now_s - self._counted_s > _COUNT_SLOTS_S:
            self._slots, self._counted_s = sum(self._client.nthreads().values()), now_s
            if self._slots:
                self._seen_s = now_s
        return max(self._slots, 1)

    def look_after(self) -> None:
        self.slots()
        missing_s = time.monotonic() - self._seen_s
        if missing_s > _NO_WORKERS_S:
            raise RobocupVisionError(
                f"the dask scheduler at '{self._address}' has had no workers for {missing_s:.0f} s"
            )


class _Plugin(WorkerPlugin):
    """Holds what all pieces need on each worker."""

    do: Doer

    def __init__(self, start: Start[Any, Any], wanted: str) -> None:
        self._start, self._wanted = start, wanted

    def setup(self, worker: Any) -> None:
        found = _version()
        if found != self._wanted:
            raise ArgumentError(f"worker {worker.address} has robocup-vision {found}, this machine has {self._wanted}")
        only_one_opencv_thread()
        self.do = Doer(self._start)


def _version() -> str:
    try:
        return version("robocup-vision")
    except PackageNotFoundError:
        return "(not installed)"


def _do(name: str, batch: list[Any]) -> list[Any]:
    plugin = get_worker().plugins[name]
    assert isinstance(plugin, _Plugin)
    return plugin.do(batch)
