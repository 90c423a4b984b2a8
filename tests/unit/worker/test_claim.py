"""Heartbeats are sent when due, and what they bring ends the work."""

from __future__ import annotations

import os
import time
from types import SimpleNamespace

import pytest

from store.errors import StoreBusy
from worker.claim import CancelledError, Claim, LostError, Stop, StoppedError

TASK = SimpleNamespace(id="t")


class Queue:
    """Answers heartbeats from a list."""

    def __init__(self, *answers):
        self.answers = list(answers)
        self.beats = []

    def heartbeat(self, task, stage, fraction):
        self.beats.append((task.id, stage, fraction))
        answer = self.answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer


@pytest.fixture
def clock(monkeypatch):
    now = SimpleNamespace(time=100.0)
    monkeypatch.setattr("worker.claim.time.monotonic", lambda: now.time)
    return now


def test_a_heartbeat_brings_the_progress_no_more_often_than_needed(clock):
    queue = Queue("ok", "ok")
    claim = Claim(TASK, queue, Stop(), lease_seconds=0.9)
    claim.progress("clean", 0.1)
    claim.progress("denoise", 0.2)
    claim.tick()
    assert queue.beats == []
    clock.time += 0.31
    claim.tick()
    claim.tick()
    assert queue.beats == [("t", "denoise", 0.2)]
    clock.time += 0.31
    claim.tick()
    assert len(queue.beats) == 2


def test_a_long_lease_still_hears_of_a_cancellation_soon(clock):
    claim = Claim(TASK, Queue("cancel"), Stop(), lease_seconds=3600)
    clock.time += 1.0
    with pytest.raises(CancelledError):
        claim.tick()


def test_a_lost_claim_ends_the_work(clock):
    claim = Claim(TASK, Queue("lost"), Stop(), lease_seconds=30)
    clock.time += 10
    with pytest.raises(LostError):
        claim.tick()


def test_a_busy_database_is_asked_again(clock):
    queue = Queue(StoreBusy(), "ok")
    claim = Claim(TASK, queue, Stop(), lease_seconds=30)
    for _ in range(2):
        clock.time += 10
        claim.tick()
    assert len(queue.beats) == 2


def test_a_stop_gives_what_runs_its_grace_and_a_second_one_takes_it(clock):
    stop = Stop(grace_seconds=5)
    claim = Claim(TASK, Queue(*["ok"] * 9), stop, lease_seconds=30)
    assert not stop.requested
    stop.request()
    assert stop.requested
    clock.time += 4.9
    claim.tick()
    clock.time += 0.2
    with pytest.raises(StoppedError):
        claim.tick()
    stop = Stop(grace_seconds=5)
    stop.request()
    stop.request()
    assert stop.overdue


def test_a_disk_that_is_slower_than_the_lease_keeps_the_claim():
    queue = Queue(StoreBusy(), *["ok"] * 99)
    with Claim(TASK, queue, Stop(), lease_seconds=0.03).kept():
        time.sleep(0.3)
    assert len(queue.beats) > 2
    beats = len(queue.beats)
    time.sleep(0.05)
    assert len(queue.beats) == beats


def test_a_claim_that_was_lost_while_a_disk_was_slow_ends_the_work():
    claim = Claim(TASK, Queue(*["lost"] * 99), Stop(), lease_seconds=0.03)
    with pytest.raises(LostError), claim.kept():
        time.sleep(0.1)


def test_the_end_of_the_lifeline_is_a_request_to_stop():
    reader, writer = os.pipe()
    stop = Stop(lifeline=reader)
    assert not stop.requested
    os.close(writer)
    assert stop.requested
    os.close(reader)
