"""The worker's loop: what it waits for, and how each outcome of a job is written."""

from __future__ import annotations

import contextlib
import io
import threading
import time
from types import SimpleNamespace

import pytest

from reebase.errors import NoFaces
from store import collections, evaluations, migrate, shapes, tasks
from store.errors import ProfileChanged, StorageFull, StoreBusy, UnsupportedDatabase
from store.settings import Settings
from worker import main
from worker.claim import CancelledError, LostError, Stop, StoppedError
from worker.jobs import describe
from worker.main import Worker, await_schema
from worker.sandbox import ChildError, Sandbox, SandboxError

MODULE = "tests.unit.worker.misbehaving"


@pytest.fixture
def settings(tmp_path):
    return Settings(home=tmp_path, max_crashes=3)


def test_the_schema_is_waited_for(settings):
    later = threading.Timer(0.3, lambda: migrate.upgrade(settings.database_url))
    later.start()
    await_schema(settings.database_url, Stop(), patience=30)
    later.join()


def test_a_database_without_schema_is_refused_in_words_and_not_made(settings):
    with pytest.raises(UnsupportedDatabase, match="run `reebase migrate`"):
        await_schema(settings.database_url, Stop(), patience=0.1)
    assert not (settings.home / "reebase.sqlite").exists()


def test_a_stop_ends_the_wait(settings):
    stop = Stop()
    stop.request()
    with pytest.raises(StoppedError):
        await_schema(settings.database_url, stop)


@pytest.fixture
def worker(settings, monkeypatch):
    """A worker whose child computes nothing, with one task waiting; it does not pause."""
    migrate.upgrade(settings.database_url)
    monkeypatch.setattr(main, "_PAUSE_SECONDS", 0.0)
    with Worker(settings, "tester", Stop(), Sandbox(computations=MODULE)) as worker:
        yield worker


def queued(worker):
    with worker._database.write() as conn:
        collection = collections.create(conn, "c")
        shape, _ = shapes.add(conn, collection.id, sha256="0" * 64, bytes=1, format="ply", name="n")
        return tasks.enqueue(conn, "describe", collection_id=collection.id, shape_id=shape.id)


def outcome(worker, monkeypatch, error):
    """The task after a job that raised this."""
    def job(tools, claim):
        raise error

    monkeypatch.setitem(main._JOBS, "describe", job)
    task = queued(worker)
    worker.run(once=True)
    with worker._database.read() as conn:
        return tasks.get(conn, task.id)


@pytest.mark.parametrize(
    ("error", "code", "crashes"),
    [
        (ChildError("timed_out", "Too long.", True, {"seconds": 1}), "timed_out", 0),
        (ChildError("child_crashed", "Killed.", False, {}), "child_crashed", 3),
        (NoFaces(), "no_faces", 0),
        (StorageFull(), "storage_full", 3),
        (ProfileChanged(), "profile_changed", 3),
        (ZeroDivisionError("division by zero"), "internal_error", 3),
    ],
)
def test_a_failure_is_written_with_its_reason(worker, monkeypatch, error, code, crashes):
    task = outcome(worker, monkeypatch, error)
    assert (task.state, task.error_code, task.crashes) == ("failed", code, crashes)
    assert task.error_detail["message"]


def test_a_cancelled_job_ends_as_cancelled(worker, monkeypatch):
    assert outcome(worker, monkeypatch, CancelledError()).state == "cancelled"


@pytest.mark.parametrize("error", [LostError(), StoreBusy()])
def test_a_lost_claim_writes_nothing(worker, monkeypatch, error):
    task = outcome(worker, monkeypatch, error)
    assert (task.state, task.crashes, task.worker) == ("running", 0, "tester")


def test_a_sandbox_that_fails_ends_the_worker_and_puts_the_task_back(worker, monkeypatch):
    with pytest.raises(SandboxError):
        outcome(worker, monkeypatch, SandboxError("no memory"))
    assert worker._queue.claim("another").crashes == 0


def test_a_stopped_job_is_put_back_without_blame(worker, monkeypatch):
    def job(tools, claim):
        worker.stop.request()
        raise StoppedError

    monkeypatch.setitem(main._JOBS, "describe", job)
    task = queued(worker)
    worker.run()
    with worker._database.read() as conn:
        found = tasks.get(conn, task.id)
    assert (found.state, found.crashes) == ("queued", 0)


@pytest.mark.parametrize(("error", "kept"), [(NoFaces(), False), (StoppedError(), True)])
def test_the_mesh_of_a_query_goes_with_the_end_of_its_task(worker, monkeypatch, error, kept):
    def job(tools, claim):
        worker.stop.request()
        raise error

    monkeypatch.setitem(main._JOBS, "query", job)
    sha256 = worker._tools.blobs.put_if_absent(b"mesh")
    with worker._database.write() as conn:
        tasks.enqueue(conn, "query", blob=sha256)
    worker.run(once=True)
    assert worker._tools.blobs.exists(sha256) is kept


@pytest.mark.parametrize("computation", ["describe", "evaluate"])
def test_results_that_are_written_slowly_keep_the_claim(worker, monkeypatch, computation):
    """Every blob takes longer to write than the lease lasts; the child is left out."""
    files = dict.fromkeys([*describe.results.BLOBS, "description", "kept", "report", "matrix"])
    finished = SimpleNamespace(files=files, answer={"refused": {}})
    finished.files["report"] = io.BytesIO(b"{}")
    finished.files["limbs"], finished.files["parts"] = io.BytesIO(), io.BytesIO()
    another = []

    def put_if_absent(pieces):
        time.sleep(1.5)
        another.append(worker._queue.claim("another"))
        return "1" * 64

    @contextlib.contextmanager
    def run(*_, **__):
        yield finished

    monkeypatch.setattr(worker._queue, "_lease", 1.2)
    monkeypatch.setattr(worker._tools.blobs, "put_if_absent", put_if_absent)
    monkeypatch.setattr(type(worker._tools), "described", run)
    monkeypatch.setattr(worker._sandbox, "run", run)
    monkeypatch.setattr(describe.Description, "load", lambda _: None)
    monkeypatch.setattr(describe.kept, "load", lambda _: {})
    monkeypatch.setattr(describe.results, "store_description", lambda conn, task, *_, **__: tasks.succeed(conn, task))
    task = queued(worker)
    if computation == "evaluate":
        with worker._database.write() as conn:
            tasks.cancel(conn, task.id)
            params = {"measure": "matching"}
            task = evaluations.create(conn, params=params, collection_id=task.collection_id).task
    worker.run(once=True)
    with worker._database.read() as conn:
        assert tasks.get(conn, task.id).state == "succeeded"
    assert set(another) == {None}


def test_a_worker_that_is_never_idle_sweeps_too(worker, monkeypatch):
    swept = []
    monkeypatch.setattr(main.sweep, "sweep", lambda *_: swept.append(True))
    outcome(worker, monkeypatch, NoFaces())
    assert swept == [True]


def test_an_idle_worker_sweeps(worker, monkeypatch):
    swept = []

    def sweep(*_):
        swept.append(True)
        worker.stop.request()

    monkeypatch.setattr(main.sweep, "sweep", sweep)
    worker.run()
    assert swept == [True]
