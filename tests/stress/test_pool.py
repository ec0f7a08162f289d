"""Workers that hang or die are replaced, and their tasks named."""

import os
import time

from needlefem._progress import expect_steps
from needlefem.stress import Lost, WorkerLimits, work_through


def work(task: int) -> int:
    if task == 1:
        while True:
            pass
    if task == 2:
        os._exit(7)
    if task == 3:
        bytearray(10**12)
    if task == 4:
        time.sleep(1000)
    if task in {6, 7}:
        expect_steps(20 if task == 6 else 2000)
        begun = time.process_time()
        while time.process_time() < begun + 1.0:
            pass
    return 10 * task


def test_every_task_has_an_answer() -> None:
    limits = WorkerLimits(seconds=0.4, clock=60.0, memory=1e10)
    found = dict(work_through(work, [0, 1, 2, 3, 5], processes=2, limits=limits))
    assert found[0] == 0
    assert found[5] == 50
    assert found[1] == Lost("not ready after 0.4 s of processor time")
    assert found[2] == Lost("the process ended with code 7")
    assert found[3] == Lost("out of memory")


def test_a_task_that_sleeps_is_lost() -> None:
    limits = WorkerLimits(seconds=0.4, clock=1.0, memory=1e10)
    [(task, answer)] = work_through(work, [4], processes=1, limits=limits)
    assert task == 4
    assert isinstance(answer, Lost)
    assert "no answer within" in answer.reason


def test_announced_time_steps_have_their_time() -> None:
    limits = WorkerLimits(seconds=0.4, clock=60.0, memory=1e10, seconds_a_step=0.005)
    found = dict(work_through(work, [6, 7], processes=1, limits=limits))
    assert found[7] == 70
    assert found[6] == Lost("not ready after 0.4 s of processor time")
