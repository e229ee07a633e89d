# SPDX-License-Identifier: Apache-2.0
"""Worker processes: on the processor cores of this machine, or of a Dask cluster.

Both do the same: work through items, a bounded number at a time, and give the results in the order
of the items. A worker that dies costs the time of what it had in hand, which is done again.
"""

from __future__ import annotations

import logging
import math
import multiprocessing
import os
import signal
import socket
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from typing import Any, Generic, TypeVar
from urllib.parse import urlsplit

from leg_kinematics.errors import LegError, ValueRangeError

Item = TypeVar("Item")
Result = TypeVar("Result")

AHEAD = 3  # items in hand or waiting for each worker, so that none is idle
MOST_LOSSES = 2  # workers may die that often in a row without anything being done
COUNT_PERIOD = 2.0  # workers may join and leave a cluster, which may end [s]
CONNECT_TIMEOUT = 10.0  # the scheduler and its first worker answer within that time [s]


class WorkerError(LegError):
    """The workers are out of reach, or die again and again."""


@dataclass
class _Task(Generic[Item, Result]):
    """An item that is not worked off yet; without a future it has to be handed out (again)."""

    item: Item
    future: Future[Result] | None = None

    @property
    def done(self) -> bool:
        """Whether its result is there."""
        future = self.future
        return (
            future is not None
            and future.done()
            and not future.cancelled()
            and future.exception() is None
        )


class Workers(ABC):
    """Processes that work; as a context manager it ends what it started."""

    losses: tuple[type[BaseException], ...]  # what a future raises if its worker is lost

    @property
    @abstractmethod
    def count(self) -> int:
        """Number of items that can be worked on at once."""

    @abstractmethod
    def close(self) -> None:
        """End what was started here."""

    @abstractmethod
    def _submit(self, function: Callable[[Item], Result], item: Item) -> Future[Result]:
        """Hand out an item."""

    def _result(self, future: Future[Result]) -> Result:
        """Wait for the result of what was handed out, or raise that its worker is lost."""
        return future.result()

    @abstractmethod
    def _recover(self, error: BaseException) -> None:
        """Replace workers that were lost, or raise a WorkerError."""

    def __enter__(self) -> Workers:
        """Return the workers; leaving the block closes them."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the workers."""
        self.close()

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """Yield function(item) for each item, in order.

        Items are drawn as fast as they are worked off, so there may be any number of them.

        Raises:
            WorkerError: If the workers are lost for good.
        """
        source = iter(items)
        tasks: deque[_Task[Item, Result]] = deque()
        try:
            while True:
                while len(tasks) < AHEAD * self.count:
                    try:
                        tasks.append(_Task(next(source)))
                    except StopIteration:
                        break
                if not tasks:
                    return
                try:
                    for task in tasks:
                        task.future = task.future or self._submit(function, task.item)
                    result: Any = self._result(tasks[0].future)  # type: ignore[arg-type]
                except self.losses as error:
                    self._recover(error)
                    for task in tasks:
                        task.future = task.future if task.done else None
                else:
                    tasks.popleft()
                    yield result
        finally:
            for task in tasks:
                if task.future is not None:
                    task.future.cancel()


class LocalWorkers(Workers):
    """Processes on this machine.

    Args:
        count: Number of processes; None for one a processor core that this process may use.

    Raises:
        ValueRangeError: If the number is not positive.
    """

    losses = (BrokenProcessPool,)

    def __init__(self, count: int | None = None) -> None:
        self._count = len(os.sched_getaffinity(0)) if count is None else count
        if self._count < 1:
            raise ValueRangeError(f"workers: {count}; allowed: >= 1")
        self._lost_in_a_row = 0
        self._pool = self._make_pool()

    @property
    def count(self) -> int:
        """Number of processes."""
        return self._count

    @property
    def processes(self) -> tuple[int, ...]:
        """Identifiers of the processes that run now."""
        return tuple(self._pool._processes or ())

    def close(self) -> None:
        """End the processes."""
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _make_pool(self) -> ProcessPoolExecutor:
        # A fork would copy the threads of ROS and of the numeric libraries in an unknown state.
        return ProcessPoolExecutor(
            self._count, multiprocessing.get_context("spawn"), initializer=_attend_parent
        )

    def _submit(self, function: Callable[[Item], Result], item: Item) -> Future[Result]:
        with _interrupts_blocked():
            future = self._pool.submit(function, item)  # may start a process
        future.add_done_callback(self._note)
        return future

    def _note(self, future: Future[Any]) -> None:
        if not future.cancelled() and future.exception() is None:
            self._lost_in_a_row = 0

    def _recover(self, error: BaseException) -> None:
        self._lost_in_a_row += 1
        if self._lost_in_a_row > MOST_LOSSES:
            raise WorkerError(
                f"workers: processes died {self._lost_in_a_row} times before anything was done"
            ) from error
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._pool = self._make_pool()


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Start processes that Ctrl-C does not reach: it is for their parent, and they inherit this."""
    resource_tracker.ensure_running()  # would unblock it when it starts
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _attend_parent() -> None:
    """Let a worker end when its parent is gone, also if that was killed."""
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)


class DaskWorkers(Workers):
    """The workers of a Dask scheduler; each must have this package installed.

    Args:
        address: Address of the scheduler, such as "tcp://head:8786".

    Raises:
        WorkerError: If the scheduler does not answer, or has no worker.
    """

    def __init__(self, address: str) -> None:
        from distributed import Client, KilledWorker  # slow to import
        from distributed.client import ClosedClientError, FutureCancelledError
        from distributed.comm.core import CommClosedError

        lost_here = (CommClosedError, ClosedClientError)
        self.losses = (KilledWorker, *lost_here, FutureCancelledError, CancelledError)
        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # errors are raised here
        self._address = address
        self._count, self._counted = 1, -math.inf
        _check_reachable(address)
        try:
            self._client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
        except (OSError, ValueError) as error:
            raise WorkerError(f"scheduler {address}: not reachable ({error})") from None
        try:
            self._client.wait_for_workers(1, timeout=CONNECT_TIMEOUT)
        except TimeoutError:
            self._client.close()
            raise WorkerError(f"scheduler {address}: has no worker; start one") from None
        self._executor = self._client.get_executor(pure=False)

    @property
    def count(self) -> int:
        """Number of threads of all workers, now or a moment ago; one while there is none."""
        if time.monotonic() > self._counted + COUNT_PERIOD:
            self._check_open()
            try:
                self._count = max(1, sum(self._client.nthreads().values()))
            except OSError as error:
                self._recover(error)
            self._counted = time.monotonic()
        return self._count

    def close(self) -> None:
        """Drop what is under way and leave the cluster."""
        with suppress(*self.losses):  # the client may have closed by itself
            self._executor.shutdown(wait=False)
        self._client.close()

    def _submit(self, function: Callable[[Item], Result], item: Item) -> Future[Result]:
        future: Future[Result] = self._executor.submit(function, item)
        return future

    def _result(self, future: Future[Result]) -> Result:
        # What is handed out while the client closes, having lost its scheduler, never ends.
        while not wait([future], COUNT_PERIOD).done:
            self._check_open()
        return future.result()

    def _check_open(self) -> None:
        if self._client.status in ("closing", "closed"):
            self._recover(ConnectionError("no answer"))

    def _recover(self, error: BaseException) -> None:
        # The scheduler has handed the work to other workers already, as often as it allows.
        raise WorkerError(f"scheduler {self._address}: workers lost: {error}") from None


def _check_reachable(address: str) -> None:
    """Raise a WorkerError if nobody listens; a Dask client would take long to find out."""
    parts = urlsplit(address)
    try:
        if not parts.hostname or not parts.port:
            raise WorkerError(f"scheduler {address!r}: allowed: tcp://HOST:PORT")
        socket.create_connection((parts.hostname, parts.port), CONNECT_TIMEOUT).close()
    except (OSError, ValueError) as error:
        raise WorkerError(f"scheduler {address}: not reachable ({error})") from None


def open_workers(count: int | None = None, scheduler: str = "") -> Workers:
    """Return the workers of a Dask scheduler if its address is given, else local ones."""
    return DaskWorkers(scheduler) if scheduler else LocalWorkers(count)
