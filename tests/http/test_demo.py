"""`reebase demo`, as a process, beside a service that already runs on the same home."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import httpx
import pytest

from reebase.client import Client
from reebase.errors import ParameterError
from service.demo import demo
from tests.http.serving import ROOT, environment, whole_service

DEMO = [sys.executable, "-m", "service", "demo", "--per-class", "1"]


def children_of(pid: int) -> list[int]:
    return [int(one) for one in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def test_the_demo_beside_a_running_service_then_again(tmp_path: Path) -> None:
    home, picture = tmp_path / "home", tmp_path / "answer.svg"
    with whole_service(home) as served:
        arguments = [*DEMO, "--picture", str(picture)]
        ran = subprocess.run(arguments, cwd=ROOT, env=environment(home), capture_output=True, text=True, check=False)
        assert ran.returncode == 0, ran
        assert "hands-00" in ran.stdout
        assert "making and uploading: 10/10" in ran.stderr
        assert "describing: 10/10" in ran.stderr
        assert "\x1b" not in ran.stdout + ran.stderr
        assert picture.read_text().startswith("<?xml")
        # The service that was there before answers from the same database.
        with Client(served.url) as client:
            first = {shape.name: shape for shape in client.shapes("demo")}
            assert {shape.state for shape in first.values()} == {"indexed"}
            answer = client.query("demo", shape=first["humans-00"].id, k=9, tolerance=None)
            assert {hit.shape.name for hit in answer.hits} == first.keys() - {"humans-00"}
            client.delete_shape("demo", first["snakes-00"].id)
            # A second run, with that service itself, makes what is missing and leaves the rest.
            ran = subprocess.run(
                [*arguments, "--url", served.url, "--query", "hands-00"], cwd=ROOT, env=environment(home),
                capture_output=True, text=True, check=False,
            )  # fmt: skip
            assert ran.returncode == 0, ran
            second = {shape.name: shape for shape in client.shapes("demo")}
        assert second.keys() == first.keys()
        assert [name for name in first if first[name].id != second[name].id] == ["snakes-00"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_demo_leaves_no_service(tmp_path: Path, number: signal.Signals) -> None:
    home = tmp_path / "home"
    process = subprocess.Popen(
        DEMO, cwd=ROOT, env=environment(home), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    log, end = home / "demo.log", time.monotonic() + 60
    while time.monotonic() < end and not (log.exists() and "/v1/collections" in log.read_text()):
        time.sleep(0.05)
    server = children_of(process.pid)
    assert server
    process.send_signal(number)
    _, err = process.communicate(timeout=40)
    assert process.returncode == 128 + number
    assert "Traceback" not in err
    assert "the shapes in the collection 'demo' are kept" in err
    for pid in server:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
    address = next(line.split()[-1] for line in log.read_text().splitlines() if line.startswith("  address"))
    with pytest.raises(httpx.ConnectError):
        httpx.get(f"{address}/livez")


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"query": "zebras-00"}, "zebras"),
        ({"query": "ants-02", "per_class": 2}, "ants-00 to ants-01"),
        ({"picture": Path("a.jpg")}, "svg"),
        ({"picture": Path("/")}, "is a folder"),
    ],
)
def test_what_cannot_work_is_refused_before_a_service_is_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: dict[str, Any], complaint: str
) -> None:
    monkeypatch.setenv("REEBASE_HOME", str(tmp_path))
    with pytest.raises(ParameterError, match=complaint):
        demo(**options)
    assert not (tmp_path / "demo.log").exists()
