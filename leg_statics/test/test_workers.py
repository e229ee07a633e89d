# SPDX-License-Identifier: Apache-2.0
"""Workers: order, bounds, and what the death of a process costs."""

import itertools
import json
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Future

import pytest

from leg_kinematics import ValueRangeError
from leg_statics.design.search.workers import AHEAD, LocalWorkers, WorkerError, open_workers

# Worker processes cannot import this module: what they do is told as expressions for `eval`.
PROCESS = "__import__('os').getpid()"
PATIENCE = 120.0  # longer than it takes on any machine, however busy [s]
DIE = "__import__('os').kill(__import__('os').getpid(), 9)"


def squares(count):
    return [f"{x}**2" for x in range(count)]


def slow(expressions):
    return (f"(__import__('time').sleep(0.02), {code})[1]" for code in expressions)


def until(event, more):
    """Count until an event, and a few more."""
    numbers = itertools.takewhile(lambda _: not event.is_set(), itertools.count())
    last = 0
    for last in numbers:
        yield last
    yield from range(last + 1, last + 1 + more)


@pytest.fixture(scope="module")
def workers():
    with LocalWorkers(2) as workers:
        yield workers


def test_results_come_in_order(workers):
    assert list(workers.map(eval, squares(50))) == [x * x for x in range(50)]
    assert set(workers.map(eval, [PROCESS] * 50)) <= set(workers.processes)


def test_items_are_drawn_only_as_fast_as_they_are_worked_off(workers):
    drawn = []
    results = workers.map(eval, (drawn.append(x) or x for x in squares(1000)))
    for done, _ in enumerate(results, start=1):
        assert len(drawn) <= done + AHEAD * workers.count
        if done == 20:
            break


def test_what_the_work_raises_is_raised(workers):
    with pytest.raises(ZeroDivisionError, match="division by zero"):
        list(workers.map(eval, ["1", "1 / 0", "2"]))
    assert list(workers.map(eval, ["9"])) == [9]


def test_a_process_that_is_killed_costs_no_result():
    with LocalWorkers(2) as workers:
        results = []
        for k, result in enumerate(workers.map(eval, slow(squares(40)))):
            results.append(result)
            if k == 10:
                os.kill(workers.processes[0], signal.SIGKILL)
        assert results == [x * x for x in range(40)]


def test_processes_that_always_die_end_the_work():
    with LocalWorkers(1) as workers, pytest.raises(WorkerError, match="died 3 times"):
        list(workers.map(eval, [DIE] * 3))


PARENT = """
import time
from leg_statics.design.search.workers import LocalWorkers
if __name__ == "__main__":
    with LocalWorkers(1) as workers:
        print(*workers.map(eval, ["__import__('os').getpid()"]), flush=True)
        time.sleep(3600.0)
"""


def test_processes_end_when_their_parent_is_killed(tmp_path):
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    parent = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True)
    child = int(parent.stdout.readline())
    parent.kill()
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + PATIENCE
    while is_alive(child):
        assert time.monotonic() < deadline, "the worker outlives its parent"
        time.sleep(0.01)


def is_alive(pid):
    """Whether a process runs; a dead one that nobody has waited for does not."""
    try:
        with open(f"/proc/{pid}/stat") as file:  # noqa: PTH123  a path of the kernel
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_a_number_of_workers_that_is_not_positive_is_refused():
    with pytest.raises(ValueRangeError, match="workers: 0; allowed: >= 1"):
        LocalWorkers(0)


# --------------------------------------------------------------------------- Dask


class Cluster:
    """A scheduler and workers as real processes of this machine."""

    def __init__(self, folder, count):
        self.file = folder / "scheduler.json"
        options = ["--scheduler-file", str(self.file), "--no-dashboard"]
        self.scheduler = self._start("scheduler", *options, "--port", "0", "--host", "127.0.0.1")
        self.workers = [
            self._start("worker", *options, "--no-nanny", "--nthreads", "1", "--name", str(k))
            for k in range(count)
        ]

    def _start(self, kind, *options):
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{kind}", *options],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def address(self):
        deadline = time.monotonic() + PATIENCE
        while not self.file.exists() or not self.file.read_text():
            assert time.monotonic() < deadline, "no scheduler"
            time.sleep(0.01)
        return json.loads(self.file.read_text())["address"]

    def stop(self):
        # A Dask worker that is asked to end says goodbye to its scheduler, even to a lost one.
        for process in [*self.workers, self.scheduler]:
            process.kill()
        for process in [*self.workers, self.scheduler]:
            process.wait()


@pytest.fixture
def cluster(tmp_path):
    cluster = Cluster(tmp_path, 2)
    yield cluster
    cluster.stop()


def test_a_dask_worker_that_is_killed_costs_no_result_and_a_lost_scheduler_is_told(cluster):
    with open_workers(scheduler=cluster.address()) as workers:
        while workers.count < 2:
            time.sleep(0.01)
        first, second = cluster.workers
        working = threading.Event()  # when both have done something
        items = (f"({x}**2, {PROCESS})" for x in until(working, 30))
        results, processes = [], set()
        for result, process in workers.map(eval, slow(items)):
            results.append(result)
            processes.add(process)
            if processes == {first.pid, second.pid} and not working.is_set():
                working.set()
                first.kill()
                first.wait()
        assert results == [x * x for x in range(len(results))]

        endless = workers.map(eval, slow(f"{x}**2" for x in itertools.count()))
        assert next(endless) == 0
        cluster.scheduler.kill()
        with pytest.raises(WorkerError, match=r"scheduler tcp://127\.0\.0\.1:.*lost"):
            list(endless)


def test_what_is_asked_of_a_client_that_has_closed_is_lost(cluster):
    with open_workers(scheduler=cluster.address()) as workers:
        workers._client.sync(workers._client._close)  # as it does when it has lost its scheduler
        with pytest.raises(WorkerError, match=r"scheduler tcp://127\.0\.0\.1:.*lost"):
            list(workers.map(eval, ["1"]))
        # what Dask takes while its client closes it neither hands out nor cancels
        with pytest.raises(WorkerError, match="no answer"):
            workers._result(Future())


def test_a_scheduler_out_of_reach_is_told(monkeypatch):
    monkeypatch.setattr("leg_statics.design.search.workers.CONNECT_TIMEOUT", 0.5)
    with pytest.raises(WorkerError, match=r"scheduler tcp://127\.0\.0\.1:9: not reachable"):
        open_workers(scheduler="tcp://127.0.0.1:9")
