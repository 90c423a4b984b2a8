"""Who may do what: keys, scopes, collections, rates, quotas; and the guards against other people's web pages."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest
from sqlalchemy import update

from service.guards import host_name
from service.rates import RateLimiter
from service.routes import about
from service.settings import ServiceSettings
from store import keys, outputs, tables, tasks
from store.engine import Database
from store.errors import StorageFull
from store.records import Task
from store.sql import now
from tests.http.serving import Served, api_alone
from tests.http.test_problems import is_problem
from tests.http.test_uploads import different

Make = Callable[..., httpx.Client]


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """An API that asks for keys."""
    with api_alone(tmp_path_factory.mktemp("guarded"), require_keys=True) as served:
        yield served


@pytest.fixture(scope="module")
def keyed(guarded: Served) -> Iterator[Make]:
    """Makes a key and a client that sends it."""
    clients: list[httpx.Client] = []
    database = guarded.database()

    def make(scope: str, collection: str | None = None, **limits: int) -> httpx.Client:
        with database.write() as conn:
            _, secret = keys.create(conn, scope, collection, **limits)
        clients.append(guarded.client(headers={"Authorization": f"Bearer {secret}"}))
        return clients[-1]

    yield make
    for client in clients:
        client.close()
    database.close()


def test_without_a_key(guarded: Served) -> None:
    with guarded.client() as client:
        for path in ("/v1/collections", "/v1/limits", "/v1/absent", "/metrics"):
            reply = client.get(path)
            is_problem(reply, 401, "missing_key")
            assert reply.headers["www-authenticate"].startswith("Bearer ")
        for path in ("/livez", "/readyz", "/", "/docs", "/openapi.json"):
            assert client.get(path).status_code == 200


@pytest.mark.parametrize("header", ["Bearer rb_wrong", "Basic eDp5", "Bearer", "rb_x", "Bearer é"])
def test_a_wrong_key(guarded: Served, header: str) -> None:
    with guarded.client() as client:
        reply = client.get("/v1/collections", headers=[(b"authorization", header.encode("latin-1"))])
        is_problem(reply, 401, "invalid_key")
        assert "www-authenticate" in reply.headers


def test_a_key_is_asked_for_before_the_body_is_read(guarded: Served) -> None:
    with guarded.client() as client:
        is_problem(client.post("/v1/collections", content=b"{"), 401, "missing_key")


def test_a_revoked_key(guarded: Served) -> None:
    database = guarded.database()
    with database.write() as conn:
        key, secret = keys.create(conn, "read")
    with guarded.client(headers={"Authorization": f"Bearer {secret}"}) as client:
        assert client.get("/v1/collections").status_code == 200
        with database.write() as conn:
            assert keys.get(conn, key.id).last_used_at is not None
            keys.revoke(conn, key.id)
        is_problem(client.get("/v1/collections"), 401, "invalid_key")
    database.close()


def test_a_key_opens_while_the_database_cannot_be_written(
    keyed: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise StorageFull

    reader = keyed("read")
    monkeypatch.setattr(keys, "used", full)
    assert reader.get("/v1/collections").status_code == 200


def test_scopes(keyed: Make) -> None:
    read, write, admin = keyed("read"), keyed("write"), keyed("admin")
    is_problem(read.post("/v1/collections", json={"name": "scopes"}), 403, "forbidden_scope")
    assert write.post("/v1/collections", json={"name": "scopes"}).status_code == 201
    assert read.get("/v1/collections/scopes").status_code == 200
    is_problem(read.post("/v1/collections/scopes/shapes", content=b"x"), 403, "forbidden_scope")
    shape = write.post("/v1/collections/scopes/shapes", content=different(1)).json()["shape"]["id"]
    is_problem(read.patch(f"/v1/collections/scopes/shapes/{shape}", json={"name": "a"}), 403, "forbidden_scope")
    is_problem(read.delete(f"/v1/collections/scopes/shapes/{shape}"), 403, "forbidden_scope")
    is_problem(read.post("/v1/evaluations", json={"collection": "scopes"}), 403, "forbidden_scope")
    query = {"shape": shape}
    is_problem(read.post("/v1/collections/scopes/query", json=query), 404, "result_not_found")
    value = is_problem(write.delete("/v1/collections/scopes"), 403, "forbidden_scope")
    assert value["details"] == {"needed": "admin", "found": "write"}
    assert admin.delete("/v1/collections/scopes").status_code == 204


def test_a_key_of_one_collection(keyed: Make) -> None:
    admin = keyed("admin")
    for name in ("mine", "yours"):
        admin.post("/v1/collections", json={"name": name})
        admin.post(f"/v1/collections/{name}/shapes", content=different(2))
        admin.post("/v1/evaluations", json={"collection": name})
    mine = keyed("write", "mine")
    assert [one["name"] for one in mine.get("/v1/collections").json()["items"]] == ["mine"]
    assert mine.get("/v1/collections/mine").status_code == 200
    for name in ("yours", "absent"):
        is_problem(mine.get(f"/v1/collections/{name}"), 403, "forbidden_scope")
    is_problem(mine.post("/v1/collections", json={"name": "third"}), 403, "forbidden_scope")
    is_problem(mine.post("/v1/evaluations", json={"synthetic": {}}), 403, "forbidden_scope")
    is_problem(mine.post("/v1/evaluations", json={"collection": "yours"}), 403, "forbidden_scope")
    is_problem(mine.get("/v1/tasks?collection=yours"), 403, "forbidden_scope")
    for kind, code in (("tasks", "task_not_found"), ("evaluations", "evaluation_not_found")):
        seen = {one["id"] for one in mine.get(f"/v1/{kind}").json()["items"]}
        others = {one["id"] for one in admin.get(f"/v1/{kind}").json()["items"]} - seen
        assert seen and others
        for other in others:
            is_problem(mine.get(f"/v1/{kind}/{other}"), 404, code)
    for name in ("mine", "yours"):
        admin.delete(f"/v1/collections/{name}")


def test_a_key_has_a_rate(keyed: Make) -> None:
    slow, other = keyed("read", requests_per_minute=12), keyed("read")
    replies = [slow.get("/v1/limits") for _ in range(4)]
    assert [reply.status_code for reply in replies[:2]] == [200, 200]
    is_problem(replies[3], 429, "rate_limited")
    assert 1 <= int(replies[3].headers["retry-after"]) <= 5
    assert other.get("/v1/limits").status_code == 200


def test_a_token_bucket() -> None:
    now = [0.0]
    limiter = RateLimiter(names=2, clock=lambda: now[0])
    assert [limiter.wait("a", 60) for _ in range(11)] == [0] * 10 + [1]
    now[0] = 0.5
    assert limiter.wait("a", 60) == 1
    now[0] = 1.0
    assert [limiter.wait("a", 60), limiter.wait("a", 60)] == [0, 1]
    assert limiter.wait("b", 1) == 0
    assert limiter.wait("b", 1) == 60
    assert limiter.wait("c", 60) == 0  # forgets the least recent, which is a
    assert limiter.wait("a", 60) == 0


def test_a_key_has_a_quota(keyed: Make) -> None:
    keyed("admin").post("/v1/collections", json={"name": "small"})
    key = keyed("write", max_shapes=1)
    assert key.post("/v1/collections/small/shapes", content=different(3)).status_code == 202
    value = is_problem(
        key.post("/v1/collections/small/shapes", content=different(4)), 403, "quota_exceeded"
    )
    assert value["details"]["limit"] == 1
    # What is there already costs nothing.
    assert key.post("/v1/collections/small/shapes", content=different(3)).status_code == 200
    items = key.get("/v1/collections/small/shapes").json()["items"]
    assert len(items) == 1
    assert key.delete(f"/v1/collections/small/shapes/{items[0]['id']}").status_code == 204
    assert key.post("/v1/collections/small/shapes", content=different(4)).status_code == 202


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "evil.example:80", ""])
def test_names_that_are_not_ours(api: httpx.Client, host: str) -> None:
    for path in ("/", "/v1/collections", "/readyz"):
        is_problem(api.get(path, headers={"Host": host}), 421, "unknown_host")


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:8000", "127.0.0.1", "[::1]:8000", "localhost."])
def test_names_that_are_ours(api: httpx.Client, host: str) -> None:
    assert api.get("/v1/limits", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "https://evil.example"}, {"Origin": "null"}, {"Origin": "http://127.0.0.1:1"},
        {"Origin": "http://["}, {"Sec-Fetch-Site": "cross-site"}, {"Sec-Fetch-Site": "same-site"},
    ],
)  # fmt: skip
def test_pages_of_other_origins_change_nothing(api: httpx.Client, headers: dict[str, str]) -> None:
    for method, path in (("POST", "/v1/collections"), ("DELETE", "/v1/collections/a"), ("PATCH", "/v1/x")):
        is_problem(api.request(method, path, headers=headers), 403, "foreign_origin")


def test_our_own_page_may_change_things(api: httpx.Client, alone: Served) -> None:
    headers = {"Origin": alone.url, "Sec-Fetch-Site": "same-origin"}
    assert api.post("/v1/collections", json={"name": "own"}, headers=headers).status_code == 201


def test_a_key_stands_for_itself_wherever_the_page_comes_from(keyed: Make) -> None:
    reply = keyed("admin").post(
        "/v1/collections", json={"name": "app"}, headers={"Origin": "https://app.example"}
    )
    assert reply.status_code == 201
    assert "access-control-allow-origin" not in reply.headers


def test_no_other_page_reads_us(api: httpx.Client, alone: Served) -> None:
    for path in ("/", "/v1/collections", "/docs"):
        reply = api.get(path, headers={"Origin": "https://evil.example"})
        assert "access-control-allow-origin" not in reply.headers
        assert reply.headers["cross-origin-resource-policy"] == "same-origin"
        assert "default-src 'none'" in reply.headers["content-security-policy"]
        assert "unsafe" not in reply.headers["content-security-policy"]


@pytest.mark.parametrize(
    ("header", "name"),
    [("a.example:80", "a.example"), ("[::1]:8", "::1"), ("A.Example.", "a.example"), ("[::1", ""), ("", "")],
)
def test_host_name(header: str, name: str) -> None:
    assert host_name(header) == name


@pytest.mark.parametrize(
    ("host", "loopback"),
    [("127.0.0.1", True), ("127.1.2.3", True), ("::1", True), ("localhost", True), ("0.0.0.0", False),  # noqa: S104
     ("::", False), ("192.168.1.5", False), ("reebase.example", False)],
)  # fmt: skip
def test_who_needs_a_key(tmp_path: Path, host: str, loopback: bool) -> None:
    chosen = ServiceSettings(home=tmp_path, host=host)
    assert chosen.loopback is loopback
    assert chosen.anonymous is loopback
    assert ServiceSettings(home=tmp_path, host=host, allow_anonymous=True).anonymous
    assert not ServiceSettings(home=tmp_path, host=host, require_keys=True).anonymous
    assert (chosen.known_hosts is not None) is loopback


def test_names_are_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("REEBASE_HOSTS", "Shapes.example, other.example")
    known = ServiceSettings(home=tmp_path, host="192.168.1.5").known_hosts
    assert known is not None and {"shapes.example", "other.example", "localhost"} <= known


def test_a_reader_cancels_the_queries_it_asked_and_nothing_else(keyed: Make) -> None:
    admin, reader, other = keyed("admin"), keyed("read"), keyed("read")
    admin.post("/v1/collections", json={"name": "asked"}).raise_for_status()
    shape = admin.post("/v1/collections/asked/shapes", content=different(70)).json()["task"]["id"]
    own, foreign = (
        client.post("/v1/collections/asked/query?wait=0", content=different(71)).json()["task"]["id"]
        for client in (reader, other)
    )
    assert reader.post(f"/v1/tasks/{own}/cancel").json()["state"] == "cancelled"
    for task in (shape, foreign):
        is_problem(reader.post(f"/v1/tasks/{task}/cancel"), 403, "forbidden_scope")
    assert admin.post(f"/v1/tasks/{foreign}/cancel").json()["state"] == "cancelled"


def test_probes_answer_while_every_thread_is_busy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Requests that measure for long must not make the service look dead to what watches it."""
    held, free = threading.Semaphore(0), threading.Event()

    class Slow:
        def __iter__(self) -> Iterator[str]:
            held.release()
            free.wait(60)
            return iter(["ply"])

    monkeypatch.setattr(about, "WRITTEN", Slow())
    with api_alone(tmp_path) as served, served.client() as client, ThreadPoolExecutor(60) as many:
        try:
            asked = [many.submit(client.get, "/v1/formats", timeout=90) for _ in range(60)]
            for _ in range(40):  # as many as there are threads
                assert held.acquire(timeout=30)
            assert client.get("/livez", timeout=10).status_code == 200
            assert client.get("/readyz", timeout=10).status_code == 200
        finally:
            free.set()
        assert {one.result().status_code for one in asked} == {200}


def held(database: Database, task_id: str) -> Task:
    """A queued task, now as if a worker had claimed it."""
    with database.write() as conn:
        change = update(tables.task).where(tables.task.c.id == task_id)
        conn.execute(change.values(state="running", attempt=1, worker="w", lease_until=now(60)))
        return tasks.get(conn, task_id)


def finish(served: Served, task_id: str, made: tuple[str, ...]) -> None:
    """Ends a queued task as its worker would, with files of a few bytes."""
    database, blobs = served.database(), served.blobs()
    task = held(database, task_id)
    names = {name: blobs.put_if_absent(json.dumps([name, task_id]).encode()) for name in made}
    with database.write() as conn:
        result = {} if task.kind == "query" else DENOISED
        outputs.complete(conn, task, result, names)
    database.close()


DENOISED = {
    "method": "mean", "iterations": 1, "boundary": "curve", "parameters": {}, "choice": None, "vertices": 3, "faces": 1,
    "mean_edge_length": 1.0,    "displacement": {"mean": 0.0, "largest": 0.0}, "errors": None,
}  # fmt: skip


def ask_both(client: httpx.Client, served: Served, seed: int) -> list[str]:
    """The addresses of what a finished query and a finished denoising made."""
    client.post("/v1/collections", json={"name": "fetched"})
    query = client.post("/v1/collections/fetched/query?wait=0", content=different(seed)).json()["task"]["id"]
    denoising = client.post("/v1/denoise?wait=0", content=different(seed + 1)).json()["task"]["id"]
    finish(served, query, ("thumbnail", "display", "skeleton", "limbs"))
    finish(served, denoising, ("mesh",))
    drawn = [f"/v1/tasks/{query}/{what}" for what in ("thumbnail", "display", "skeleton", "skeleton?of=extended")]
    return [*drawn, f"/v1/denoise/{denoising}", f"/v1/denoise/{denoising}/mesh"]


def test_what_was_made_of_a_mesh_that_is_not_kept_is_for_the_key_that_sent_it(keyed: Make, guarded: Served) -> None:
    admin, reader, writer, other = keyed("admin"), keyed("read"), keyed("write"), keyed("read")
    admin.post("/v1/collections", json={"name": "fetched"}).raise_for_status()
    inside = keyed("write", "fetched")
    addresses = ask_both(reader, guarded, 80)
    for address in addresses:
        for client in (reader, admin):
            assert client.get(address).status_code == 200, address
        etag = reader.get(address).headers.get("etag")
        for client in (writer, other, inside):
            headers = {} if etag is None else {"If-None-Match": etag}
            refused = is_problem(client.get(address, headers=headers), 404, "task_not_found")
            # As of a task that there never was.
            task = address.split("/")[3]
            absent = client.get(address.replace(task, "0" * len(task))).json()["detail"]
            assert refused["detail"] == absent.replace("0" * len(task), task)


def test_where_no_keys_are_needed_everyone_fetches_everything(tmp_path: Path) -> None:
    with api_alone(tmp_path / "open") as served:
        database = served.database()
        with database.write() as conn:
            secrets = [keys.create(conn, "write")[1] for _ in range(2)]
        database.close()
        one, other = (served.client(headers={"Authorization": f"Bearer {secret}"}) for secret in secrets)
        with one, other, served.client() as nobody:
            for address in ask_both(one, served, 90) + ask_both(nobody, served, 92):
                for client in (one, other, nobody):
                    assert client.get(address).status_code == 200, address
