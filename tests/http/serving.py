"""Servers for tests: the whole service as its command starts it, or the API alone inside this process."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import uvicorn

from service.app import create_app
from service.settings import ServiceSettings
from store import migrate
from store.blobs import LocalBlobs
from store.engine import Database

ROOT = Path(__file__).resolve().parent.parent.parent
START_SECONDS = 90.0


@dataclass
class Served:
    """A running service: where it answers, and where it keeps things."""

    url: str
    home: Path
    process: subprocess.Popen[str] | None = None

    def client(self, **arguments: Any) -> httpx.Client:
        return httpx.Client(base_url=self.url, timeout=120.0, **arguments)

    def database(self) -> Database:
        return Database(f"sqlite:///{self.home / 'reebase.sqlite'}")

    def blobs(self) -> LocalBlobs:
        return LocalBlobs(self.home / "blobs")

    def unfinished(self) -> list[str]:
        """What uploads have left half written."""
        return sorted(path.name for path in (self.home / "blobs" / "unfinished").glob("*"))


def environment(home: Path, **more: str) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("REEBASE_")}
    return {**kept, "REEBASE_HOME": str(home), **more}


@contextmanager
def whole_service(home: Path, *options: str, **variables: str) -> Iterator[Served]:
    """``python -m service serve`` on a free port, with its worker; ready when the block begins."""
    home.mkdir(parents=True, exist_ok=True)
    log = home / "log.txt"
    with log.open("w") as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", "service", "serve", "--port", "0", *options], cwd=ROOT, text=True,
            stdout=subprocess.PIPE, stderr=errors, env=environment(home, **variables),
        )  # fmt: skip
        try:
            yield Served(_address(process, log), home, process)
        finally:
            process.send_signal(signal.SIGTERM)
            try:
                process.communicate(timeout=40)
            finally:
                process.kill()
                process.wait()


def _address(process: subprocess.Popen[str], log: Path) -> str:
    assert process.stdout is not None
    for line in process.stdout:
        if found := re.search(r"address +(http://\S+)", line):
            url = found[1]
            break
    else:
        raise AssertionError(f"The service did not start:\n{log.read_text()}")
    end = time.monotonic() + START_SECONDS
    while time.monotonic() < end:
        try:
            if httpx.get(f"{url}/readyz").status_code == 200:
                return url
        except httpx.TransportError:
            pass
        time.sleep(0.05)
    raise AssertionError(f"The service did not become ready:\n{log.read_text()}")


@contextmanager
def api_alone(home: Path, **settings: Any) -> Iterator[Served]:
    """The API in a thread of this process, without a worker, so that a test can reach into it."""
    chosen = ServiceSettings(home=home, **settings)
    migrate.upgrade(chosen.database_url)
    server = uvicorn.Server(uvicorn.Config(create_app(chosen), port=0, log_config=None, access_log=False))
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        end = time.monotonic() + START_SECONDS
        while not server.started and time.monotonic() < end:
            time.sleep(0.01)
        port = server.servers[0].sockets[0].getsockname()[1]
        yield Served(f"http://127.0.0.1:{port}", home)
    finally:
        server.should_exit = True
        thread.join()
