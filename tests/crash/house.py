"""A house of its own for one crash test: a directory, settings, and the real processes that live in it."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import httpx
import numpy as np
from sqlalchemy import func, select

from reebase.mesh import Mesh
from reebase.mesh.write import to_bytes
from store import collections, migrate, results, shapes, sweep, tables, tasks
from store.blobs import LocalBlobs
from store.engine import Database
from store.settings import Settings
from tests.shapes import torus

ROOT = Path(__file__).resolve().parents[2]
LEASE = 1.2


def alive(process):
    """False also for a process that is dead and not yet waited for."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except (FileNotFoundError, ProcessLookupError):
        return False


def wait_until(condition, seconds=30.0, what="that"):
    """The first true value of the condition."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = condition()
        if found:
            return found
        time.sleep(0.02)
    raise AssertionError(f"{what} did not happen within {seconds:g} s")


def mesh_bytes(number):
    """A small mesh like no other."""
    mesh = torus(2.0, 0.5, 24, 12)
    stretch = np.array([1.0, 1.3, 1.0 + 0.01 * number])
    return to_bytes(Mesh(mesh.vertices * stretch, mesh.faces), "ply")


class Started:
    """A process, its log, and the files by which it can be held."""

    def __init__(self, process, log):
        self.process = process
        self.log = log

    @property
    def pid(self):
        return self.process.pid

    def events(self, name):
        """The lines of the log about one event, decoded."""
        found = []
        for line in self.log.read_text().splitlines():
            with suppress(ValueError):
                record = json.loads(line)
                if record.get("event") == name:
                    found.append(record)
        return found

    def await_event(self, name, seconds=60.0):
        def seen():
            assert self.process.poll() is None or self.events(name), self.log.read_text()
            return self.events(name)

        return wait_until(seen, seconds, f"the event {name!r}")[0]

    def kill(self, number=signal.SIGKILL):
        with suppress(ProcessLookupError):
            self.process.send_signal(number)

    def end(self, seconds=20.0):
        """Wait for its end and return the exit status."""
        return self.process.wait(seconds)


class House:
    """Settings, database and blobs of one test, and its processes."""

    def __init__(self, home, **settings):
        self.home = home
        self.environment = {
            "REEBASE_HOME": str(home), "REEBASE_LEASE_SECONDS": str(LEASE), "REEBASE_MAX_CRASHES": "1000",
            "REEBASE_SWEEP_GRACE_SECONDS": "3600",
            **{f"REEBASE_{name.upper()}": str(value) for name, value in settings.items()},
        }  # fmt: skip
        self.started = []
        names = {name.removeprefix("REEBASE_").lower(): v for name, v in self.environment.items()}
        self.settings = Settings(**names)
        migrate.upgrade(self.settings.database_url)
        self.database = Database(self.settings.database_url)
        self.blobs = LocalBlobs(self.settings.blobs)

    def close(self):
        for started in self.started:
            started.kill()
            started.kill(signal.SIGCONT)
            started.end()
        self.database.close()

    def start(self, module, *arguments, fault="", stdin=subprocess.DEVNULL, **variables):
        log = self.home / f"{module}-{len(self.started)}.log"
        with log.open("wb") as stream:
            process = subprocess.Popen(
                [sys.executable, "-m", module, *arguments], cwd=ROOT, stdin=stdin, stdout=stream,
                stderr=stream, env={**os.environ, **self.environment, **variables, "REEBASE_FAULT": fault},
            )  # fmt: skip
        self.started.append(Started(process, log))
        return self.started[-1]

    def start_worker(self, *arguments, fault="", ready=True, **variables):
        worker = self.start("worker", *arguments, fault=fault, **variables)
        if ready:
            worker.await_event("ready")
        return worker

    def start_service(self, fault="", **variables):
        """The API alone, and a client of it."""
        service = self.start("service", "serve", "--no-worker", "--port", "0", fault=fault, **variables)

        def answers():
            assert service.process.poll() is None, service.log.read_text()
            found = re.search(r"address +(http://\S+)", service.log.read_text())
            with suppress(httpx.TransportError):
                return found and httpx.get(f"{found[1]}/readyz") and found[1]

        return service, httpx.Client(base_url=wait_until(answers, 60, "the service's start"), timeout=30)

    def collection(self, name="animals"):
        with self.database.write() as conn:
            return collections.create(conn, name)

    def upload(self, collection, number, *, label=None):
        """What the service does for an upload; returns shape and task."""
        data = mesh_bytes(number)
        sha256 = self.blobs.put_if_absent(data)
        with self.database.write() as conn:
            shape, created = shapes.add(
                conn, collection.id, sha256=sha256, bytes=len(data), format="ply", name=f"mesh {number}",
                label=label,
            )  # fmt: skip
            assert created
            task = tasks.enqueue(conn, "describe", collection_id=collection.id, shape_id=shape.id)
        return shape, task

    def task(self, task):
        with self.database.read() as conn:
            return tasks.get(conn, task.id)

    def await_end(self, *waiting, seconds=60.0):
        """The tasks once all have ended."""
        def ended():
            found = [self.task(task) for task in waiting]
            return found if all(task.ended for task in found) else None

        return wait_until(ended, seconds, "the end of the tasks")

    def await_state(self, task, state, seconds=30.0):
        return wait_until(lambda: self.task(task).state == state, seconds, f"state {state}")

    def sweep(self, grace_seconds):
        settings = self.settings.model_copy(update={"sweep_grace_seconds": grace_seconds})
        return sweep.sweep(self.database, self.blobs, settings)

    def check(self):
        """What must hold whatever happened: nothing in between, nothing twice, nothing dangling."""
        with self.database.read() as conn:
            all_shapes = conn.execute(select(tables.shape)).mappings().all()
            live = conn.execute(
                select(func.count()).where(tables.task.c.state.in_(("queued", "running")))
            ).scalar_one()
            described = conn.execute(select(tables.endpoint_features.c.shape_id)).scalars().all()
            assert live == 0
            assert len({(row["collection_id"], row["sha256"]) for row in all_shapes}) == len(all_shapes)
            assert len(set(described)) == len(described)
            assert {row["id"] for row in all_shapes if row["state"] == "indexed"} == set(described)
            for row in all_shapes:
                task = tasks.get(conn, row["task_id"])
                assert row["state"] in ("indexed", "failed", "cancelled")
                assert task.state == ("succeeded" if row["state"] == "indexed" else row["state"])
                if row["state"] == "failed":
                    assert task.error_code
                    assert task.error_detail["message"]
                else:
                    assert self.blobs.exists(row["sha256"])
                if row["state"] == "indexed":
                    kept = results.skeleton(conn, row["id"])
                    assert self.blobs.exists(kept.cleaned_sha256)
                    assert self.blobs.exists(kept.denoised_sha256)
        self.blobs.get(all_shapes[0]["sha256"])
