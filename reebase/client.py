"""The typed client of the HTTP service.

    with Client("http://127.0.0.1:8000") as reebase:
        reebase.create_collection("zoo")
        upload = reebase.upload("zoo", "octopus.ply", label="octopuses")
        reebase.wait(upload.task)
        for hit in reebase.query("zoo", shape=upload.shape.id).hits:
            print(hit.rank, hit.shape.name, hit.dissimilarity)

Every refusal of the service is raised as a ServiceError with the service's own stable ``code`` and words.
Requests that are safe to repeat (reads, and uploads, which are identified by their content) are repeated when
the connection breaks or the service is busy.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np
import numpy.typing as npt

from reebase.errors import MissingPackage, ReebaseError
from reebase.mesh.health import Health
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read
from reebase.mesh.write import to_bytes
from reebase.skeleton.graph import Skeleton

try:
    import httpx
except ImportError as missing:  # pragma: no cover - depends on what is installed
    raise MissingPackage("The client needs httpx: pip install 'reebase[client]'.") from missing

__all__ = [
    "Answer", "Client", "Collection", "Hit", "Pair", "ServiceError", "ServiceUnreachable", "Shape", "Task",
    "TaskFailed", "Unmatched", "Upload",
]  # fmt: skip

Source = str | os.PathLike[str] | bytes | Mesh
_Record = TypeVar("_Record")
_ATTEMPTS = 5
_BUSY = frozenset({429, 502, 503, 504})


class ServiceError(ReebaseError):
    """The service refused the request.

    status: the HTTP status; code: the service's stable code; details: the whole problem document.
    """

    def __init__(self, status: int, problem: Mapping[str, Any]) -> None:
        self.status = status
        self.code = str(problem.get("code", "unknown"))
        message = str(problem.get("detail") or problem.get("title") or f"HTTP {status}")
        super().__init__(message, problem=dict(problem))


class ServiceUnreachable(ReebaseError):
    """The service did not answer."""

    code = "service_unreachable"


class TaskFailed(ReebaseError):
    """A task ended without its result."""

    code = "task_failed"

    def __init__(self, task: Task) -> None:
        self.task = task
        reason = task.error or {}
        super().__init__(
            f"The {task.kind} task {task.id} ended as {task.state}: "
            f"{reason.get('detail', 'no reason given')} [{reason.get('code', task.state)}]",
            task=task.id,
        )


@dataclass(frozen=True)
class Collection:
    """A named set of shapes that went through one profile of the pipeline.

    counts: ``shapes`` in all, ``states`` by state, and ``endpoints``: indexed shapes by endpoint count.
    """

    name: str
    description: str
    profile: dict[str, Any]
    profile_key: str
    counts: dict[str, Any]
    created_at: str


@dataclass(frozen=True)
class Shape:
    """A stored shape.

    state: queued, running, indexed, failed or cancelled; error: why it failed; task: the id of the task that
    the state follows; flags: what is unusual, explained in the health report.
    """

    id: str
    name: str
    sha256: str
    state: str | None = None
    label: str | None = None
    tags: tuple[str, ...] = ()
    metadata: dict[str, Any] | None = None
    format: str | None = None
    endpoint_count: int | None = None
    flags: tuple[str, ...] = ()
    task: str | None = None
    error: dict[str, Any] | None = None


@dataclass(frozen=True)
class Task:
    """Work in the background; ``progress`` names the stage and the fraction that is done."""

    id: str
    kind: str
    state: str
    progress: dict[str, Any] | None = None
    error: dict[str, Any] | None = None
    result: dict[str, Any] | None = None

    @property
    def ended(self) -> bool:
        return self.state in ("succeeded", "failed", "cancelled")


@dataclass(frozen=True)
class Upload:
    """What an upload led to; ``created`` is False when the same bytes were there already."""

    shape: Shape
    task: Task | None
    created: bool


@dataclass(frozen=True)
class Pair:
    """A matched pair of endpoints, by their rows in the two feature arrays, and its distance Phi."""

    query: int
    hit: int
    distance: float


@dataclass(frozen=True)
class Unmatched:
    """An endpoint without a partner, and what it adds to D."""

    endpoint: int
    charge: float


@dataclass(frozen=True)
class Hit:
    """A ranked shape with its dissimilarity D(G, G~) and the reasons for it."""

    rank: int
    shape: Shape
    dissimilarity: float
    endpoint_count: int
    pairs: tuple[Pair, ...]
    unmatched_query: tuple[Unmatched, ...]
    unmatched_hit: tuple[Unmatched, ...]


@dataclass(frozen=True)
class Answer:
    """The answer to a query: hits from most to least similar, among ``considered`` shapes."""

    query: dict[str, Any]
    hits: tuple[Hit, ...]
    considered: int


def _record(kind: type[_Record], values: Mapping[str, Any]) -> _Record:
    """A record from a JSON object; members that this version does not know are passed over."""
    known = {f.name for f in fields(kind)}  # type: ignore[arg-type]  # every record here is a dataclass
    return kind(**{key: tuple(v) if key in ("tags", "flags") else v for key, v in values.items() if key in known})


def _answer(values: Mapping[str, Any]) -> Answer:
    hits = tuple(
        Hit(
            rank=hit["rank"],
            shape=_record(Shape, hit["shape"]),
            dissimilarity=hit["dissimilarity"],
            endpoint_count=hit["endpoint_count"],
            pairs=tuple(_record(Pair, pair) for pair in hit["pairs"]),
            unmatched_query=tuple(_record(Unmatched, one) for one in hit["unmatched_query"]),
            unmatched_hit=tuple(_record(Unmatched, one) for one in hit["unmatched_hit"]),
        )
        for hit in values["hits"]
    )
    return Answer(query=values["query"], hits=hits, considered=values["considered"])


def _payload(source: Source, name: str | None) -> tuple[str, bytes]:
    """The file name and the bytes of what is uploaded."""
    if isinstance(source, Mesh):
        return name or "mesh.ply", to_bytes(source, "ply")
    if isinstance(source, bytes):
        return name or "mesh", source
    path = Path(source)
    return path.name, path.read_bytes()


class Client:
    """A connection to a Reebase service. Thread-safe; close it, or use it in ``with``.

    url: where the service answers. api_key: where it asks for one, by default $REEBASE_API_KEY.
    timeout: seconds to wait for one reply. transport: an httpx transport, for tests without a socket.
    """

    def __init__(
        self,
        url: str = "http://127.0.0.1:8000",
        *,
        api_key: str | None = None,
        timeout: float = 120.0,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        key = api_key or os.environ.get("REEBASE_API_KEY")
        headers = {"Authorization": f"Bearer {key}"} if key else {}
        self.url = url
        self._http = httpx.Client(base_url=url, headers=headers, timeout=timeout, transport=transport)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._http.close()

    # -- collections

    def collections(self) -> Iterator[Collection]:
        """All collections, by name."""
        return (_record(Collection, one) for one in self._pages("/v1/collections", {}))

    def create_collection(
        self, name: str, *, description: str = "", profile: Mapping[str, Any] | None = None, exist_ok: bool = False
    ) -> Collection:
        """Make a collection; with ``exist_ok`` one that is there is returned as it is."""
        body = {"name": name, "description": description, "profile": dict(profile or {})}
        try:
            return _record(Collection, self._json("POST", "/v1/collections", json=body))
        except ServiceError as refusal:
            if exist_ok and refusal.code == "collection_exists":
                return self.collection(name)
            raise

    def collection(self, name: str) -> Collection:
        return _record(Collection, self._json("GET", f"/v1/collections/{name}"))

    def delete_collection(self, name: str) -> None:
        self._request("DELETE", f"/v1/collections/{name}")

    # -- shapes

    def upload(
        self,
        collection: str,
        source: Source,
        *,
        name: str | None = None,
        label: str | None = None,
        tags: Sequence[str] = (),
        metadata: Mapping[str, Any] | None = None,
    ) -> Upload:
        """Upload a mesh (a path, a file's bytes or a Mesh); it is described in the background."""
        filename, data = _payload(source, name)
        form: dict[str, Any] = {"name": name or filename}
        if label is not None:
            form["label"] = label
        if tags:
            form["tags"] = list(tags)
        if metadata is not None:
            form["metadata"] = json.dumps(dict(metadata))
        reply = self._request(
            "POST", f"/v1/collections/{collection}/shapes", data=form, files={"file": (filename, data)}, repeat=True
        )
        body = reply.json()
        task = _record(Task, body["task"]) if body.get("task") else None
        return Upload(_record(Shape, body["shape"]), task, created=reply.status_code == httpx.codes.ACCEPTED)

    def shapes(self, collection: str, **filters: Any) -> Iterator[Shape]:
        """The shapes of a collection, in the order of their upload. filters: label, tag, state, sha256."""
        return (_record(Shape, one) for one in self._pages(f"/v1/collections/{collection}/shapes", filters))

    def shape(self, collection: str, shape: str) -> Shape:
        return _record(Shape, self._json("GET", self._shape(collection, shape)))

    def update_shape(self, collection: str, shape: str, **changes: Any) -> Shape:
        """Change name, label, tags or metadata."""
        return _record(Shape, self._json("PATCH", self._shape(collection, shape), json=changes))

    def delete_shape(self, collection: str, shape: str) -> None:
        self._request("DELETE", self._shape(collection, shape))

    def skeleton(self, collection: str, shape: str) -> Skeleton:
        """The pruned skeleton of a shape. One-ring areas are not sent: ``ring_areas`` is NaN."""
        found = self._json("GET", self._shape(collection, shape) + "/skeleton")
        nodes, edges = found["nodes"], found["edges"]
        return Skeleton(
            positions=np.array([node["position"] for node in nodes], dtype=np.float64).reshape(-1, 3),
            areas=np.array([node["area"] for node in nodes], dtype=np.float64),
            ring_areas=np.full(len(nodes), np.nan),
            bands=np.array([node["band"] for node in nodes], dtype=np.int32),
            edges=np.array([edge["nodes"] for edge in edges], dtype=np.int32).reshape(-1, 2),
            lengths=np.array([edge["length"] for edge in edges], dtype=np.float64),
            endpoints=np.array([endpoint["node"] for endpoint in found["endpoints"]], dtype=np.int32),
            root=found["root"],
        )

    def features(self, collection: str, shape: str) -> npt.NDArray[np.float64]:
        """omega of each endpoint, (k, 3): relative area, relative path lengths, relative distance to the root."""
        found = self._json("GET", self._shape(collection, shape) + "/features")["features"]
        return np.asarray(found, dtype=np.float64).reshape(-1, 3)

    def health(self, collection: str, shape: str) -> Health:
        """What was found in the mesh, what was repaired, what is unusual."""
        return Health.from_json(self._json("GET", self._shape(collection, shape) + "/health")["report"])

    def mesh(self, collection: str, shape: str, *, stage: str = "denoised") -> Mesh:
        """The cleaned or the denoised mesh."""
        path = self._shape(collection, shape) + "/mesh"
        return read(self._request("GET", path, params={"stage": stage, "format": "ply"}).content, "ply")

    def original(self, collection: str, shape: str) -> bytes:
        """The bytes that were uploaded."""
        return self._request("GET", self._shape(collection, shape) + "/original").content

    # -- queries

    def query(
        self,
        collection: str,
        *,
        shape: str | None = None,
        source: Source | None = None,
        k: int = 10,
        tolerance: int | None = 2,
        measure: str = "matching",
        label: str | None = None,
        tags: Sequence[str] = (),
        metadata: Mapping[str, Any] | None = None,
        max_dissimilarity: float | None = None,
        wait: float = 600.0,
    ) -> Answer:
        """Rank a collection by a stored shape (its id) or by a mesh that is not kept.

        k: how many hits. tolerance: by how much endpoint counts may differ, None for any. measure: of D, by name.
        label, tags, metadata: only shapes that have them. Waits up to ``wait`` seconds for a mesh to be described.
        """
        if (shape is None) == (source is None):
            raise ValueError("Pass either shape= (the id of a stored shape) or source= (a mesh).")
        path = f"/v1/collections/{collection}/query"
        asked: dict[str, Any] = {"k": k, "tolerance": tolerance, "measure": measure}
        filters: dict[str, Any] = {
            "label": label, "tags": list(tags), "metadata": metadata, "max_dissimilarity": max_dissimilarity,
        }  # fmt: skip
        asked |= {name: value for name, value in filters.items() if value not in (None, [])}
        if source is None:
            return _answer(self._json("POST", path, json={"shape": shape, **asked}))
        filename, data = _payload(source, None)
        form = {key: _form_value(value) for key, value in asked.items()}
        reply = self._request("POST", path, data=form, files={"file": (filename, data)})
        if reply.status_code == httpx.codes.OK:
            return _answer(reply.json())
        result = self.wait(_record(Task, reply.json()["task"]), timeout=wait).result
        return _answer(result or {})

    # -- tasks

    def task(self, task: str) -> Task:
        return _record(Task, self._json("GET", f"/v1/tasks/{task}"))

    def tasks(self, **filters: Any) -> Iterator[Task]:
        return (_record(Task, one) for one in self._pages("/v1/tasks", filters))

    def cancel(self, task: str) -> Task:
        return _record(Task, self._json("POST", f"/v1/tasks/{task}/cancel"))

    def retry(self, task: str) -> Task:
        return _record(Task, self._json("POST", f"/v1/tasks/{task}/retry"))

    def wait(self, task: Task | None, *, timeout: float = 600.0) -> Task:
        """Wait for a task to succeed. Raises TaskFailed when it does not, TimeoutError after ``timeout`` seconds."""
        if task is None:
            raise ValueError("There is no task to wait for: the shape was there already.")
        end = time.monotonic() + timeout
        pause = 0.05
        while True:
            now = self.task(task.id)
            if now.state == "succeeded":
                return now
            if now.ended:
                raise TaskFailed(now)
            if time.monotonic() > end:
                raise TimeoutError(f"Task {task.id} is still {now.state} after {timeout:g} seconds.")
            time.sleep(pause)
            pause = min(pause * 1.5, 1.0)

    def retry_shape(self, collection: str, shape: str) -> Task:
        """Describe a shape again whose task failed or was cancelled."""
        task = self.shape(collection, shape).task
        if task is None:
            raise ValueError(f"Shape {shape} has no task to retry.")
        return self.retry(task)

    # -- evaluation and service

    def start_evaluation(self, **request: Any) -> dict[str, Any]:
        """Start an evaluation: collection=NAME, or synthetic={...}; measure, descriptor, profile."""
        return self._json("POST", "/v1/evaluations", json=request)

    def evaluation(self, evaluation: str) -> dict[str, Any]:
        """An evaluation's state and progress and, once it succeeded, its report."""
        return self._json("GET", f"/v1/evaluations/{evaluation}")

    def limits(self) -> dict[str, Any]:
        return self._json("GET", "/v1/limits")

    def ready(self) -> bool:
        """Whether the service answers and can work."""
        try:
            return self._http.get("/readyz").status_code == httpx.codes.OK
        except httpx.TransportError:
            return False

    # -- transport

    @staticmethod
    def _shape(collection: str, shape: str) -> str:
        return f"/v1/collections/{collection}/shapes/{shape}"

    def _json(self, method: str, path: str, **arguments: Any) -> dict[str, Any]:
        body: dict[str, Any] = self._request(method, path, **arguments).json()
        return body

    def _pages(self, path: str, filters: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
        parameters = {"limit": 200, **filters}
        while True:
            page = self._json("GET", path, params=parameters)
            yield from page["items"]
            if not page.get("next"):
                return
            parameters["cursor"] = page["next"]

    def _request(self, method: str, path: str, *, repeat: bool = False, **arguments: Any) -> httpx.Response:
        repeatable = repeat or method in ("GET", "PATCH", "DELETE")
        for attempt in range(1, _ATTEMPTS + 1):
            last = attempt == _ATTEMPTS or not repeatable
            try:
                reply = self._http.request(method, path, **arguments)
            except httpx.TransportError as failure:
                if last:
                    raise ServiceUnreachable(
                        f"No answer from {self.url}: {failure}. Is the service running (./run serve)?"
                    ) from failure
                time.sleep(0.2 * 2**attempt)
                continue
            if reply.is_success:
                return reply
            if reply.status_code not in _BUSY or last:
                raise ServiceError(reply.status_code, _problem(reply))
            time.sleep(_retry_after(reply, 0.2 * 2**attempt))
        raise AssertionError("the last attempt returns or raises")


def _form_value(value: Any) -> Any:
    if value is None:
        return "null"
    return json.dumps(value) if isinstance(value, Mapping) else value


def _problem(reply: httpx.Response) -> dict[str, Any]:
    try:
        body = reply.json()
    except ValueError:
        body = None
    return body if isinstance(body, dict) else {"detail": reply.text[:200], "title": reply.reason_phrase}


def _retry_after(reply: httpx.Response, default: float) -> float:
    try:
        return min(float(reply.headers["Retry-After"]), 30.0)
    except (KeyError, ValueError):
        return default
