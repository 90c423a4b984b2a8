"""`serve` and its sisters, as processes: what they print, refuse, restart, and how they end."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest
from sqlalchemy import update

from service.supervisor import Supervisor
from store import collections, migrate, tables
from store.engine import Database
from store.settings import Settings
from tests.http.serving import ROOT, Served, environment, whole_service
from tests.http.test_main_job import indexed, uploaded
from tests.shapes import capsule


def command(home: Path, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a command of the application to its end."""
    return subprocess.run(
        [sys.executable, "-m", "service", *arguments], cwd=ROOT, text=True, capture_output=True, timeout=60,
        env=environment(home, **variables), check=False,
    )  # fmt: skip


def workers_of(served: Served, count: int) -> list[int]:
    """The worker processes that are running, once there are so many."""
    end = time.monotonic() + 20
    while time.monotonic() < end:
        started = re.findall(r'"pid": (\d+), "event": "worker_started"', (served.home / "log.txt").read_text())
        found = [int(number) for number in started if alive(int(number))]
        if len(found) == count:
            return found
        time.sleep(0.05)
    raise AssertionError(f"There are {len(found)} workers, not {count}.")


def alive(process: int) -> bool:
    """Whether a process runs; one that nobody has buried yet does not."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    status = Path(f"/proc/{process}/status")
    with contextlib.suppress(FileNotFoundError):
        return "State:\tZ" not in status.read_text() if Path("/proc/self").exists() else True
    return False


def gone(processes: list[int], seconds: float = 15.0) -> bool:
    """Whether all of them end within some seconds."""
    end = time.monotonic() + seconds
    while any(alive(process) for process in processes):
        if time.monotonic() > end:
            return False
        time.sleep(0.05)
    return True


def test_a_worker_that_dies_is_started_again_and_all_end_together(tmp_path: Path) -> None:
    with whole_service(tmp_path / "home") as served:
        assert served.process is not None
        with served.client() as client:
            client.post("/v1/collections", json={"name": "a"}).raise_for_status()
            indexed(client, uploaded(client, "/v1/collections/a", capsule(length=2.0)))
            first = workers_of(served, 1)
            os.kill(first[0], signal.SIGKILL)
            indexed(client, uploaded(client, "/v1/collections/a", capsule(length=3.0)))
            second = workers_of(served, 1)
            assert second != first
        began = time.monotonic()
        served.process.terminate()
        assert served.process.wait(timeout=20) == 0
        assert time.monotonic() - began < 10
        said = [line for line in (served.home / "log.txt").read_text().splitlines() if not line.startswith("{")]
        assert [line.split()[0] for line in said] == ["Stopping:", "Stopped."]
        assert gone(second, 1.0)


def test_workers_do_not_outlive_a_killed_api(tmp_path: Path) -> None:
    with whole_service(tmp_path / "home", "--workers", "2") as served:
        assert served.process is not None
        workers = workers_of(served, 2)
        served.process.kill()
        assert gone(workers)


def test_a_signal_that_comes_before_the_server_listens_is_not_lost(tmp_path: Path) -> None:
    early = (
        "import os, signal, service.supervisor as s\n"
        "s.Supervisor.start = lambda self: os.kill(os.getpid(), signal.SIGTERM)\n"
        "from service.commands import serve\n"
        "serve(host=None, port=0, workers=0, no_worker=True, allow_anonymous=False, log_level='info')\n"
    )
    ended = subprocess.run([sys.executable, "-c", early], cwd=ROOT, env=environment(tmp_path), timeout=30, check=False)
    assert ended.returncode == 0


def test_a_worker_that_cannot_be_started_is_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    tries = []

    def refused(*_: object, **__: object) -> None:
        tries.append(time.monotonic())
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr("service.supervisor.subprocess.Popen", refused)
    monkeypatch.setattr("service.supervisor.FIRST_BACKOFF", 0.01)
    monkeypatch.setattr("service.supervisor.LAST_BACKOFF", 0.02)
    supervisor = Supervisor(1)
    supervisor.start()
    end = time.monotonic() + 10
    while len(tries) < 3 and time.monotonic() < end:
        time.sleep(0.01)
    supervisor.stop()
    assert len(tries) >= 3


def test_what_serve_says(tmp_path: Path) -> None:
    home = tmp_path / "home"
    with whole_service(home, "--no-worker") as served:
        assert served.url.startswith("http://127.0.0.1:")
        assert (home / "reebase.sqlite").is_file() and (home / "blobs").is_dir()
        port = httpx.URL(served.url).port
        taken = command(tmp_path / "other", "serve", "--no-worker", "--port", str(port))
        assert taken.returncode == 1
        assert f"cannot listen on 127.0.0.1:{port}" in taken.stderr and "Traceback" not in taken.stderr
        assert not (tmp_path / "other" / "reebase.sqlite").exists()


def test_at_level_warning_neither_requests_nor_tasks_are_logged(tmp_path: Path) -> None:
    with whole_service(tmp_path / "home", "--log-level", "warning") as served, served.client() as client:
        client.post("/v1/collections", json={"name": "a"}).raise_for_status()
        indexed(client, uploaded(client, "/v1/collections/a", capsule()))
        said = (served.home / "log.txt").read_text()
        assert all('"level": "warning"' in line for line in said.splitlines()), said
    assert command(tmp_path, "serve", "--log-level", "loud").returncode == 2


@pytest.mark.parametrize("options", [["-m", "worker", "--once"], ["-m", "service", "serve", "--port", "0"]])
def test_on_a_terminal_api_and_worker_log_lines_for_people(tmp_path: Path, options: list[str]) -> None:
    assert command(tmp_path, "migrate").returncode == 0
    main, other = os.openpty()
    arguments = [sys.executable, *options, "--log-level", "info"]
    process = subprocess.Popen(
        arguments, cwd=ROOT, env=environment(tmp_path), stdout=subprocess.DEVNULL, stderr=other
    )
    os.close(other)
    said = b""
    with contextlib.suppress(OSError):  # how a terminal says that nobody writes any more
        while part := os.read(main, 10_000):
            if b"ready" in part:
                process.terminate()
            said += part
    os.close(main)
    assert process.wait(timeout=30) == 0
    assert b"ready" in said
    assert b"{\"" not in said


def test_messages_name_the_command_that_was_typed(tmp_path: Path) -> None:
    refused = command(tmp_path, "serve", "--host", "0.0.0.0", "--no-worker", REEBASE_COMMAND="./run")  # noqa: S104
    assert "./run keys create --scope admin" in refused.stderr
    wrong = command(tmp_path, "serv", REEBASE_COMMAND="./run").stderr
    assert "Usage: ./run" in wrong and "Try './run --help'" in wrong
    assert "./run python" in command(tmp_path, "--help", REEBASE_COMMAND="./run").stdout
    assert "python" not in command(tmp_path, "--help").stdout
    assert "Usage: reebase " in command(tmp_path, "--help").stdout


def test_an_open_door_is_refused(tmp_path: Path) -> None:
    refused = command(tmp_path, "serve", "--host", "0.0.0.0", "--port", "0", "--no-worker")  # noqa: S104
    assert refused.returncode == 1
    assert "keys create" in refused.stderr and "--allow-anonymous" in refused.stderr


@pytest.mark.parametrize("guard", ["key", "option"])
def test_an_open_door_with_a_guard(tmp_path: Path, guard: str) -> None:
    home = tmp_path / "home"
    headers: dict[str, str] = {}
    options = ["--host", "0.0.0.0", "--no-worker"]  # noqa: S104
    if guard == "key":
        assert command(home, "migrate").returncode == 0
        made = command(home, "keys", "create", "--scope", "admin")
        assert re.fullmatch(r"rb_\S{40,}\n", made.stdout)
        headers = {"Authorization": f"Bearer {made.stdout.strip()}"}
    else:
        options.append("--allow-anonymous")
    with whole_service(home, *options) as served:
        port = httpx.URL(served.url).port
        url = f"http://127.0.0.1:{port}/v1/collections"
        assert httpx.get(url, headers=headers).status_code == 200
        assert httpx.get(url).status_code == (401 if guard == "key" else 200)
        # Bound to all addresses, it answers for any name.
        assert httpx.get(url, headers={**headers, "Host": "shapes.example"}).status_code == 200


def test_keys(tmp_path: Path) -> None:
    assert command(tmp_path, "migrate").returncode == 0
    made = command(tmp_path, "keys", "create", "--scope", "read", "--name", "notebook")
    identity = re.search(r"[0-9a-f-]{36}", made.stderr)
    assert made.returncode == 0 and identity
    listed = command(tmp_path, "keys", "list").stdout
    assert "notebook" in listed and made.stdout.strip() not in listed
    assert command(tmp_path, "keys", "revoke", identity[0]).returncode == 0
    for wrong in (["create", "--scope", "all"], ["create", "--scope", "read", "--collection", "absent"],
                  ["revoke", "absent"]):  # fmt: skip
        refused = command(tmp_path, "keys", *wrong)
        assert refused.returncode == 2 and "Traceback" not in refused.stderr


def test_backup_and_restore(tmp_path: Path) -> None:
    home = tmp_path / "home"
    with whole_service(home, "--no-worker") as served, served.client() as client:
        client.post("/v1/collections", json={"name": "a"}).raise_for_status()
        shape = uploaded(client, "/v1/collections/a", capsule())
        original = client.get(f"{shape}/original").content
        made = command(home, "backup", str(tmp_path / "copy"))
        assert made.returncode == 0, made.stderr
    put_back = command(tmp_path / "new", "restore", str(tmp_path / "copy"))
    assert put_back.returncode == 0, put_back.stderr
    with whole_service(tmp_path / "new", "--no-worker") as served, served.client() as client:
        assert client.get(f"{shape}/original").content == original
    assert command(tmp_path / "new", "restore", str(tmp_path / "copy")).returncode == 2


@pytest.mark.parametrize("arguments", [["keys", "list"], ["keys", "create", "--scope", "read"], ["backup", "x"]])
def test_only_serve_and_migrate_make_a_database(tmp_path: Path, arguments: list[str]) -> None:
    refused = command(tmp_path / "home", *arguments)
    assert refused.returncode == 2
    assert "no database" in refused.stderr and "migrate" in refused.stderr and "Traceback" not in refused.stderr
    assert not (tmp_path / "home" / "reebase.sqlite").exists()


def test_keys_and_backup_queue_nothing_again(tmp_path: Path) -> None:
    settings = Settings(home=tmp_path / "home")
    migrate.upgrade(settings.database_url)
    database = Database(settings.database_url)
    with database.write() as conn:
        collections.create(conn, "a")
        conn.execute(update(tables.collection).values(profile_key="of another version"))
    assert command(settings.home, "keys", "list").returncode == 0
    assert command(settings.home, "backup", str(tmp_path / "copy")).returncode == 0
    with database.read() as conn:
        assert collections.get(conn, "a").profile_key == "of another version"
    database.close()


def test_migrate(tmp_path: Path) -> None:
    first = command(tmp_path, "migrate")
    assert first.returncode == 0 and "empty ->" in first.stdout
    assert command(tmp_path, "migrate").returncode == 0


def test_a_setting_that_is_wrong(tmp_path: Path) -> None:
    refused = command(tmp_path, "migrate", REEBASE_MAX_K="many")
    assert refused.returncode == 1
    assert "REEBASE_MAX_K" in refused.stderr and "Traceback" not in refused.stderr


def test_connections_beyond_the_limit_are_refused_and_come_back(tmp_path: Path) -> None:
    with whole_service(tmp_path / "home", "--no-worker", REEBASE_MAX_CONNECTIONS="4") as served:
        address = httpx.URL(served.url)
        with contextlib.ExitStack() as stack:
            for _ in range(4):
                stack.enter_context(socket.create_connection((address.host, address.port or 80), timeout=20))
            assert httpx.get(f"{served.url}/livez").status_code == 503
        end = time.monotonic() + 10
        while httpx.get(f"{served.url}/livez").status_code != 200:
            assert time.monotonic() < end
            time.sleep(0.05)


def test_requests_that_wait_end_when_the_service_stops(tmp_path: Path) -> None:
    with whole_service(tmp_path / "home", "--no-worker") as served, served.client() as client:
        assert served.process is not None
        client.post("/v1/collections", json={"name": "a"}).raise_for_status()
        task = client.get(uploaded(client, "/v1/collections/a", capsule())).json()["task"]
        address = httpx.URL(served.url)
        with socket.create_connection((address.host, address.port or 80), timeout=20) as connection:
            connection.sendall(f"GET /v1/tasks/{task}?wait=60 HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
            time.sleep(0.3)
            served.process.terminate()
            assert connection.recv(4096).startswith(b"HTTP/1.1 200 ")
        assert served.process.wait(timeout=10) == 0
