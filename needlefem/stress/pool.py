"""Worker processes: one that hangs or crashes is replaced, and its task is reported."""

import os
import resource
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from types import FrameType
from typing import Generic, NamedTuple, TypeVar

from needlefem._progress import expect_steps, expected_steps

Answer = TypeVar("Answer")
POLL = 0.5
"""Interval for checking the time limits, s."""


class WorkerLimits(NamedTuple):
    """Limits of a task.

    Parameters
    ----------
    seconds : float, s
        Processor time.
    clock : float, s
        Elapsed time, for tasks that block without computing.
    memory : float, bytes
        Address space of the worker.
    seconds_a_step : float, s
        Processor time for each time step that the task has announced; the announcement is in every
        line of progress.
    """

    seconds: float
    clock: float
    memory: float
    seconds_a_step: float = 0.0


class Lost(NamedTuple):
    """A task without a result, with the reason."""

    reason: str


class OutOfTimeError(BaseException):
    """A task exceeded its time limit; ``except Exception`` does not catch it."""


class _Worker(Generic[Answer]):
    def __init__(self, work: Callable[[int], Answer], limits: WorkerLimits) -> None:
        context = get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, work, limits), daemon=True)
        self._process.start()
        theirs.close()
        self.task: int | None = None
        self.begun = 0.0

    def give(self, task: int) -> None:
        self.task, self.begun = task, time.monotonic()
        self.pipe.send(task)

    def end(self) -> int | None:
        """Terminate the process; return its exit code if it had already ended."""
        self._process.join(timeout=POLL)
        code = self._process.exitcode
        self._process.kill()
        self._process.join()
        self.pipe.close()
        return code


def work_through(
    work: Callable[[int], Answer],
    tasks: Sequence[int],
    *,
    processes: int,
    limits: WorkerLimits,
) -> Iterator[tuple[int, Answer | Lost]]:
    """Yield tasks with their results, or `Lost`, in the order of their ends.

    Parameters
    ----------
    work : callable
        Function of a module, because it is pickled; it takes the number of a task.
    tasks : sequence of int
    processes : int
    limits : WorkerLimits
    """
    waiting = list(reversed(tasks))
    workers = [_Worker(work, limits) for _ in range(min(processes, len(tasks)))]
    try:
        while True:
            for worker in workers:
                if worker.task is None and waiting:
                    worker.give(waiting.pop())
            busy = [worker for worker in workers if worker.task is not None]
            if not busy:
                return
            ready = wait([worker.pipe for worker in busy], timeout=POLL)
            for number, worker in enumerate(workers):
                if worker.task is None:
                    continue
                late = time.monotonic() - worker.begun > limits.clock
                if worker.pipe not in ready and not late:
                    continue
                task, answer = worker.task, _answer(worker, late=worker.pipe not in ready)
                worker.task = None
                if isinstance(answer, Lost):
                    workers[number] = _Worker(work, limits)
                yield task, answer
    finally:
        for worker in workers:
            worker.end()


def _answer(worker: _Worker[Answer], *, late: bool) -> Answer | Lost:
    if late:
        worker.end()
        return Lost(f"no answer within {time.monotonic() - worker.begun:.0f} s")
    try:
        answer: Answer = worker.pipe.recv()
    except (EOFError, ConnectionResetError):
        return Lost(f"the process ended with code {worker.end()}")
    return answer


def _serve(pipe: Connection, work: Callable[[int], Answer], limits: WorkerLimits) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent terminates its workers
    allowed = [0.0]

    def out_of_time(signum: int, frame: FrameType | None) -> None:  # noqa: ARG001  (of every signal handler)
        announced = limits.seconds_a_step * expected_steps()
        if announced <= allowed[0]:
            raise OutOfTimeError
        signal.setitimer(signal.ITIMER_PROF, announced - allowed[0])
        allowed[0] = announced

    signal.signal(signal.SIGPROF, out_of_time)
    resource.setrlimit(resource.RLIMIT_AS, (int(limits.memory), int(limits.memory)))
    while True:
        try:
            task = pipe.recv()
        except EOFError:
            os._exit(0)
        try:
            expect_steps(0)
            allowed[0] = limits.seconds
            signal.setitimer(signal.ITIMER_PROF, limits.seconds)
            answer: Answer | Lost = work(task)
            signal.setitimer(signal.ITIMER_PROF, 0.0)
        except OutOfTimeError:
            answer = Lost(f"not ready after {allowed[0]:g} s of processor time")
        except MemoryError:
            answer = Lost("out of memory")
        pipe.send(answer)
