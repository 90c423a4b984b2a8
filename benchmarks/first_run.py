"""What a newcomer waits for: `./run serve` from nothing to /readyz, to the first indexed mesh, and again warm.

    python3 benchmarks/first_run.py

Needs the standard library alone, as a newcomer's machine does. Uses a fresh environment and a fresh home in a
temporary folder unless REEBASE_VENV and REEBASE_HOME name others. Exits 1 when the service does not come up.
"""

from __future__ import annotations

import json
import math
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
COLD_LIMIT, WARM_LIMIT = 300.0, 30.0


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


def call(url: str, data: bytes | None = None, **headers: str) -> tuple[int, dict]:
    request = urllib.request.Request(url, data=data, headers=headers)  # noqa: S310 - http on loopback
    with urllib.request.urlopen(request, timeout=30) as reply:  # noqa: S310 - as above
        return reply.status, json.loads(reply.read() or b"{}")


def capsule() -> bytes:
    """A bent capsule as OFF: the smallest mesh with a skeleton of two endpoints."""
    around, along = 24, 60
    vertices, faces = [(0.0, 0.0, -1.0)], []
    for i in range(1, along):
        angle = math.pi * i / along
        z, radius = -math.cos(angle) * 3, math.sin(angle)
        vertices += [
            (radius * math.cos(2 * math.pi * j / around) + 0.1 * z * z, radius * math.sin(2 * math.pi * j / around), z)
            for j in range(around)
        ]
    vertices[0] = (0.9, 0.0, -3.0)
    vertices.append((0.9, 0.0, 3.0))
    last = len(vertices) - 1
    for j in range(around):
        k = (j + 1) % around
        faces.append((0, 1 + k, 1 + j))
        faces.append((last, last - around + j, last - around + k))
        for i in range(along - 2):
            a, b = 1 + i * around, 1 + (i + 1) * around
            faces += [(a + j, a + k, b + k), (a + j, b + k, b + j)]
    lines = [f"OFF\n{len(vertices)} {len(faces)} 0"]
    lines += [f"{x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
    lines += [f"3 {a} {b} {c}" for a, b, c in faces]
    return "\n".join(lines).encode()


def until(what: str, condition, limit: float, server: subprocess.Popen) -> float:
    """Seconds until the condition holds."""
    start = time.monotonic()
    while time.monotonic() - start < limit:
        if server.poll() is not None:
            sys.exit(f"./run serve ended with exit code {server.returncode} before {what}")
        try:
            if condition():
                return time.monotonic() - start
        except (OSError, urllib.error.URLError):
            pass
        time.sleep(0.05)
    sys.exit(f"not {what} within {limit:g} s")


def session(label: str, environment: dict[str, str], limit: float) -> None:
    base = f"http://127.0.0.1:{(port := free_port())}"
    start = time.monotonic()
    server = subprocess.Popen([str(ROOT / "run"), "serve", "--port", str(port)], env=environment, cwd=ROOT)
    try:
        until("ready", lambda: call(f"{base}/readyz")[0] == 200, limit, server)
        ready = time.monotonic() - start
        name = f"first-{label}"
        call(f"{base}/v1/collections", json.dumps({"name": name}).encode(), **{"Content-Type": "application/json"})
        upload = f"{base}/v1/collections/{name}/shapes?name=capsule.off&format=off"
        _, body = call(upload, capsule(), **{"Content-Type": "application/octet-stream"})
        shape = f"{base}/v1/collections/{name}/shapes/{body['shape']['id']}"
        until("indexed", lambda: call(shape)[1]["state"] == "indexed", 60.0, server)
        indexed = time.monotonic() - start
        print(f"{label}: /readyz after {ready:.1f} s, first mesh indexed after {indexed:.1f} s", flush=True)
    finally:
        server.send_signal(signal.SIGTERM)
        try:
            server.wait(timeout=40)
        except subprocess.TimeoutExpired:
            server.kill()
            sys.exit("./run serve did not stop within 40 s of SIGTERM")


def main() -> None:
    with tempfile.TemporaryDirectory(prefix="reebase-first-run-") as scratch:
        environment = {
            "REEBASE_VENV": f"{scratch}/venv",
            "REEBASE_HOME": f"{scratch}/home",
            **os.environ,
        }
        session("cold", environment, COLD_LIMIT)
        session("warm", environment, WARM_LIMIT)


if __name__ == "__main__":
    main()
