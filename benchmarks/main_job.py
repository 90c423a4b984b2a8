"""The main job on a fresh home: ingest folders over HTTP, then evaluate each collection and the synthetic set.

    ./run python benchmarks/main_job.py [FOLDER ...]

FOLDER holds meshes and labels.csv; by default articulated-a and rigid-a under $REEBASE_DATA or ../shared/data, where
present. Prints how many shapes were indexed, the wall time of ingestion with one worker, the largest memory of any
process of the service, and NN, FT, ST, MAP and DCG of the four measures as the evaluation endpoint reports them.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from reebase.client import Client
from reebase.matching import MEASURES

ROOT = Path(__file__).resolve().parent.parent
DATA = Path(os.environ.get("REEBASE_DATA", ROOT.parent / "shared" / "data"))
SHOWN = ("nn", "first_tier", "second_tier", "map", "dcg")


def descendants(parent: int) -> list[int]:
    """The process and all that it started, by /proc."""
    found, todo = [], [parent]
    while todo:
        process = todo.pop()
        found.append(process)
        try:
            for thread in Path(f"/proc/{process}/task").iterdir():
                todo += map(int, (thread / "children").read_text().split())
        except OSError:  # it ended while we looked
            continue
    return found


def peak_memory(process: int, peaks: dict[int, tuple[str, int]], stop: threading.Event) -> None:
    """Keeps the largest resident size of every process of the service, in KiB."""
    while not stop.wait(0.02):
        for one in descendants(process):
            try:
                status = Path(f"/proc/{one}/status").read_text()
                command = Path(f"/proc/{one}/cmdline").read_text().replace("\0", " ")[:60]
            except OSError:
                continue
            size = next((int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM")), 0)
            peaks[one] = (command, max(size, peaks.get(one, ("", 0))[1]))


def report(client: Client, name: str, **what: object) -> None:
    for measure in MEASURES:
        start = time.perf_counter()
        evaluation = client.start_evaluation(measure=measure, **what)  # type: ignore[arg-type]  # one of two
        client.wait(evaluation.task, timeout=1800)
        found = client.evaluation(evaluation.id).report or {"overall": {}}
        scores = "  ".join(f"{key} {found['overall'][key]:.3f}" for key in SHOWN)
        print(f"  {name:15s} {measure:14s} {scores}   ({time.perf_counter() - start:.1f} s)", flush=True)


def main() -> None:
    default = [DATA / name for name in ("articulated-a", "rigid-a") if (DATA / name).is_dir()]
    folders = [Path(one) for one in sys.argv[1:]] or default
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
    with tempfile.TemporaryDirectory(prefix="reebase-main-job-") as home, (Path(home) / "log").open("wb") as log:
        environment = {**os.environ, "REEBASE_HOME": home}
        command = [sys.executable, "-m", "service", "serve", "--port", str(port)]
        server = subprocess.Popen(command, env=environment, stdout=log, stderr=log, cwd=ROOT)
        peaks: dict[int, tuple[str, int]] = {}
        stop = threading.Event()
        threading.Thread(target=peak_memory, args=(server.pid, peaks, stop), daemon=True).start()
        url = f"http://127.0.0.1:{port}"
        try:
            with Client(url, patience=60) as client:
                while not client.ready():
                    time.sleep(0.1)
                for folder in folders:
                    start = time.perf_counter()
                    ingest = [sys.executable, "-m", "service", "ingest", str(folder)]
                    subprocess.run([*ingest, "--collection", folder.name, "--url", url], check=False)
                    seconds = time.perf_counter() - start
                    states = client.collection(folder.name).counts.states
                    print(f"{folder.name}: {states} in {seconds:.1f} s", flush=True)
                for folder in folders:
                    report(client, folder.name, collection=folder.name)
                report(client, "synthetic", synthetic={"per_class": 25, "seed": 0})
        finally:
            stop.set()
            server.send_signal(signal.SIGTERM)
            server.wait()
    print("largest memory of a process:")
    for command, size in sorted(peaks.values(), key=lambda one: -one[1])[:4]:
        print(f"  {size / 1024:6.0f} MiB  {command}")


if __name__ == "__main__":
    main()
