"""The client: one method a route."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import EllipsisType
from typing import IO, Any, Self, TypeVar, cast
from urllib.parse import quote

import httpx
import numpy as np
import numpy.typing as npt

from reebase.client import records
from reebase.client.errors import ServiceError, TaskFailed, WaitTimeout
from reebase.client.records import (
    Answer,
    Collection,
    Coverage,
    Denoised,
    Descriptor,
    Duplicates,
    Evaluation,
    Filter,
    Formats,
    Matrix,
    Measure,
    Readiness,
    ServiceLimits,
    Shape,
    Task,
    Upload,
)
from reebase.client.transport import Transport
from reebase.errors import ParameterError
from reebase.mesh.health import Health
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read
from reebase.mesh.write import to_bytes
from reebase.skeleton.graph import Skeleton

__all__ = ["Client", "Source"]

Source = str | os.PathLike[str] | bytes | Mesh
"""A path, a file's bytes or a mesh."""

_T = TypeVar("_T")
_PAGE = 200
_LONG_POLL = 20.0


class Client:
    """A connection to a Reebase service. Thread-safe; close it, or use it in ``with``.

    url: where the service answers. api_key: where it asks for one, by default $REEBASE_API_KEY.
    timeout: seconds to wait for one reply. patience: seconds during which a request is repeated while nobody
    answers or the service is busy, 0 for a single try. transport: an httpx transport, for tests without a socket.
    Raises ParameterError for an url or a key that cannot be one.

    Every method raises ServiceError when the service refuses (``code`` says why: ``collection_not_found``,
    ``validation_error``, ...), ServiceUnreachable when nobody answers, UnexpectedReply when something else does.
    """

    def __init__(
        self, url: str = "http://127.0.0.1:8000", *, api_key: str | None = None, timeout: float = 120.0,
        patience: float = 10.0, transport: httpx.BaseTransport | None = None,
    ) -> None:  # fmt: skip
        key = api_key or os.environ.get("REEBASE_API_KEY")
        self._http = Transport(url, api_key=key, timeout=timeout, patience=patience, transport=transport)
        self._poll = min(_LONG_POLL, timeout / 2)
        self.url = self._http.url

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections. A request of another thread that is about to be repeated gives up."""
        self._http.close()

    # -- collections

    def collections(self) -> Iterator[Collection]:
        """All collections, oldest first."""
        return self._pages(records.collection_of, "/v1/collections", {})

    def create_collection(
        self, name: str, *, description: str = "", profile: Mapping[str, Any] | None = None, exist_ok: bool = False
    ) -> Collection:
        """Make a collection; with ``exist_ok`` one that is there is returned as it is.

        profile: parameters of the pipeline that shall differ from the defaults, as ``{"bands": 64}``.
        Raises ServiceError: ``collection_exists``, ``validation_error``, ``unknown_name``.
        """
        if exist_ok:
            # First a look, because a key of this collection alone may not make any.
            try:
                return self.collection(name)
            except ServiceError as refusal:
                if refusal.code != "collection_not_found":
                    raise
        body = {"name": name, "description": description, "profile": dict(profile or {})}
        try:
            return self._get(records.collection_of, "/v1/collections", method="POST", creates=True, json=body)
        except ServiceError as refusal:
            if exist_ok and refusal.code == "collection_exists":
                return self.collection(name)
            raise

    def collection(self, name: str) -> Collection:
        """A collection with its counts. Raises ServiceError: ``collection_not_found``."""
        return self._get(records.collection_of, _collection(name))

    def update_collection(
        self, name: str, *, description: str | None = None, profile: Mapping[str, Any] | None = None
    ) -> Collection:
        """Change a collection; another profile queues all its shapes to be described again."""
        body = {"description": description, "profile": None if profile is None else dict(profile)}
        changes = {key: value for key, value in body.items() if value is not None}
        return self._get(records.collection_of, _collection(name), method="PATCH", json=changes)

    def delete_collection(self, name: str) -> None:
        """Delete a collection with all its shapes. Raises ServiceError: ``collection_not_found``."""
        self._http.request("DELETE", _collection(name))

    # -- shapes

    def upload(
        self, collection: str, source: Source, *, name: str | None = None, label: str | None = None,
        tags: Sequence[str] = (), metadata: Mapping[str, Any] | None = None, format: str | None = None,
    ) -> Upload:  # fmt: skip
        """Store a mesh; it is described in the background: ``wait(upload.task)``.

        A path is streamed. The same bytes again are the same shape, as it is: ``upload.created`` is False.
        format: where content and file name do not tell.
        Raises OSError for a file that cannot be read, RequestBroken for one that changes meanwhile, ServiceError:
        ``too_many_bytes``, ``unknown_format``, ``empty_file``, ``quota_exceeded``, ...
        """
        for tag in tags:
            if "," in tag:
                raise ParameterError(f"A tag must not hold a comma; found {tag!r}.", parameter="tags")
        form = {
            "name": name, "label": label, "tags": list(tags) or None, "format": format,
            "metadata": None if metadata is None else json.dumps(dict(metadata)),
        }  # fmt: skip
        with _opened(source, name) as (filename, content):
            reply = self._http.request(
                "POST", _collection(collection) + "/shapes", creates=True, data=_given(form),
                files={"file": (filename, content)},
            )  # fmt: skip
        created = reply.status_code == httpx.codes.ACCEPTED
        values = self._http.object_of(reply)
        return cast(Upload, self._http.built(lambda found: records.upload_of(found, created), values))

    def shapes(
        self, collection: str, *, label: str | None = None, tags: Sequence[str] = (), state: str | None = None,
        sha256: str | None = None, text: str | None = None, sort: str | None = None,
    ) -> Iterator[Shape]:  # fmt: skip
        """The shapes of a collection, oldest first; those that have all that is given.

        text: in the name, the file's name or the label. sort: ``name``, ``label``, ``endpoints``, ``bytes`` or
        ``created``, with ``-`` before it the other way round.
        """
        filters = _given({
            "label": label, "tag": list(tags) or None, "state": state, "sha256": sha256, "text": text, "sort": sort,
        })  # fmt: skip
        return self._pages(records.shape_of, _collection(collection) + "/shapes", filters)

    def shape(self, collection: str, shape: str) -> Shape:
        """A shape by its id. Raises ServiceError: ``shape_not_found``."""
        return self._get(records.shape_of, _shape(collection, shape))

    def update_shape(self, collection: str, shape: str, **changes: Any) -> Shape:
        """Change name, label (None takes it away), tags or metadata; tags and metadata are replaced whole."""
        return self._get(records.shape_of, _shape(collection, shape), method="PATCH", json=changes)

    def delete_shape(self, collection: str, shape: str) -> None:
        """Delete a shape and all that was learnt of it. Raises ServiceError: ``shape_not_found``."""
        self._http.request("DELETE", _shape(collection, shape))

    def restore_shape(self, collection: str, shape: str) -> Shape:
        """Undo its deletion, within a day. Raises ServiceError: ``shape_not_found``, ``shape_exists``."""
        return self._get(records.shape_of, _shape(collection, shape) + "/restore", method="POST")

    def delete_shapes(self, collection: str, shapes: Sequence[str]) -> tuple[str, ...]:
        """Delete up to 1000 shapes; the ids of those that were there."""
        body = {"shapes": list(shapes)}
        path = _collection(collection) + "/bulk/delete"
        return self._get(lambda found: tuple(found["deleted"]), path, method="POST", json=body)

    def restore_shapes(self, collection: str, shapes: Sequence[str]) -> tuple[str, ...]:
        """Undo deletions of up to 1000 shapes; the ids of those that are there again."""
        body = {"shapes": list(shapes)}
        path = _collection(collection) + "/bulk/restore"
        return self._get(lambda found: tuple(found["restored"]), path, method="POST", json=body)

    def label_shapes(self, collection: str, shapes: Sequence[str], label: str | None) -> int:
        """Give up to 1000 shapes a label, or with None take theirs away; how many were there."""
        body = {"shapes": list(shapes), "label": label}
        path = _collection(collection) + "/bulk/label"
        return self._get(lambda found: int(found["labelled"]), path, method="POST", json=body)

    def labels(self, collection: str) -> dict[str | None, int]:
        """Each label with the number of its shapes, most first; None for shapes without one."""
        path = _collection(collection) + "/labels"
        return self._get(lambda found: {row["label"]: row["shapes"] for row in found["items"]}, path)

    def add_synthetic(self, collection: str, *, per_class: int = 25, seed: int = 0) -> Task:
        """Fill the collection with the labelled synthetic set; a task makes one shape after another."""
        body = {"per_class": per_class, "seed": seed}
        return self._get(records.task_of, _collection(collection) + "/synthetic", method="POST", json=body)

    def make_map(self, collection: str, *, descriptor: str | None = None) -> Task:
        """Have the map of the collection made, unless it is current."""
        body = {"descriptor": descriptor}
        return self._get(records.task_of, _collection(collection) + "/map", method="POST", json=body)

    def map(self, collection: str, *, descriptor: str | None = None) -> dict[str, tuple[float, float]]:
        """Where shapes lie on the latest map, by id, both coordinates in [-1, 1]; empty before there is one."""
        path = _collection(collection) + "/map"
        asked = _given({"descriptor": descriptor})
        return self._get(
            lambda found: {one["shape"]: (one["x"], one["y"]) for one in found["points"]}, path, params=asked
        )

    def retry_shape(self, collection: str, shape: str) -> Task:
        """Describe a shape again that failed or was cancelled. Raises ServiceError: ``task_not_retryable``."""
        task = self.shape(collection, shape).task
        if task is None:
            raise ParameterError(f"Shape {shape} has no task to retry.", parameter="shape")
        return self.retry(task)

    # -- what was learnt of a shape. All raise ServiceError: ``result_not_found`` until it is indexed.

    def skeleton(self, collection: str, shape: str, *, of: str = "srg") -> Skeleton:
        """The pruned skeleton of a shape; of="extended": the one whose endpoints ``extended`` matches, in its order.

        One-ring areas are not sent: ``ring_areas`` is NaN.
        """
        return self._get(_skeleton_of, f"{_shape(collection, shape)}/skeleton?of={quote(of, safe='')}")

    def field(self, collection: str, shape: str) -> npt.NDArray[np.float64]:
        """phi_2 at each vertex of the denoised mesh, (m,); NaN off its largest component."""
        return self._get(records.field_of, _shape(collection, shape) + "/field")

    def scalar(self, collection: str, shape: str, name: str) -> npt.NDArray[np.float32]:
        """A scalar at each vertex of the denoised mesh, (m,), NaN where unknown: ``phi2``, ``displacement``, ..."""
        path = f"{_shape(collection, shape)}/fields/{quote(name, safe='')}"
        return np.frombuffer(self._http.request("GET", path).content, dtype="<f4")

    def thumbnail(self, collection: str, shape: str) -> bytes:
        """A small picture, PNG with a transparent ground."""
        return self._http.request("GET", _shape(collection, shape) + "/thumbnail").content

    def display_mesh(self, collection: str, shape: str) -> bytes:
        """A GLB of at most 100,000 faces with scalar fields, and the surface before denoising as a morph target."""
        return self._http.request("GET", _shape(collection, shape) + "/display").content

    def features(self, collection: str, shape: str) -> npt.NDArray[np.float64]:
        """omega of each endpoint, (k, 3): relative area, relative path lengths, relative distance to the root."""
        return self._get(_features_of, _shape(collection, shape) + "/features")

    def health(self, collection: str, shape: str) -> Health:
        """What was found in the mesh, what was repaired, what is unusual."""
        return self._get(lambda found: Health.from_json(found["report"]), _shape(collection, shape) + "/health")

    def mesh(self, collection: str, shape: str, *, stage: str = "denoised") -> Mesh:
        """The ``cleaned`` or the ``denoised`` mesh."""
        return read(self.mesh_bytes(collection, shape, stage=stage, format="ply"), "ply")

    def mesh_bytes(self, collection: str, shape: str, *, stage: str = "denoised", format: str = "glb") -> bytes:
        """The ``cleaned`` or ``denoised`` mesh as a file: ply, glb, obj, stl or off."""
        parameters = {"stage": stage, "format": format}
        return self._http.request("GET", _shape(collection, shape) + "/mesh", params=parameters).content

    def original(self, collection: str, shape: str) -> bytes:
        """The bytes that were uploaded; they are there before the shape is indexed."""
        return self._http.request("GET", _shape(collection, shape) + "/original").content

    # -- queries

    def query(
        self, collection: str, *, shape: str | None = None, source: Source | None = None, k: int = 10,
        descriptor: str | None = None, measure: str | None = None, rerank: bool | None = None,
        tolerance: int | EllipsisType | None = ..., label: str | None = None, tags: Sequence[str] = (),
        metadata: Mapping[str, Any] | None = None, max_dissimilarity: float | None = None, wait: float = 600.0,
    ) -> Answer:  # fmt: skip
        """Rank a collection by a stored shape (its id) or by a mesh that is not kept.

        k: how many hits. descriptor: what ranks, see ``descriptors``; measure: how that is compared; rerank: of
        ``fused``, whether nearest neighbours refine it. tolerance: by how much endpoint counts may differ, None for
        any. What is left out is the service's default.
        label, tags, metadata: only shapes that have them. wait: seconds for a mesh to be described.
        Raises ParameterError unless one of shape and source is given; ServiceError: ``collection_not_found``,
        ``shape_not_found``, ``result_not_found``, ``unknown_name``, and what an upload may; TaskFailed, WaitTimeout.
        """
        if (shape is None) == (source is None):
            raise ParameterError("Pass either shape= (the id of a stored shape) or source= (a mesh).")
        path = _collection(collection) + "/query"
        asked = {
            "k": k, "descriptor": descriptor, "measure": measure, "rerank": rerank, "label": label,
            "tags": list(tags) or None,
            "metadata": None if metadata is None else dict(metadata), "max_dissimilarity": max_dissimilarity,
        }  # fmt: skip
        if source is None:
            body = {"shape": shape, **_given(asked)}
            if tolerance is not ...:
                body["tolerance"] = tolerance
            return self._get(records.answer_of, path, method="POST", reads=True, json=body)
        end = time.monotonic() + wait
        form = _given({**asked, "metadata": None if metadata is None else json.dumps(dict(metadata))})
        if tolerance is not ...:
            form["tolerance"] = "null" if tolerance is None else tolerance
        form["wait"] = min(max(wait, 0.0), self._poll)
        with _opened(source, None) as (filename, content):
            reply = self._http.request("POST", path, creates=True, data=form, files={"file": (filename, content)})
        found = self._http.object_of(reply)
        if reply.status_code == httpx.codes.ACCEPTED:
            task = self._http.built(lambda values: records.task_of(values["task"]), found)
            found = self.wait(task, timeout=end - time.monotonic()).result or {}
        return cast(Answer, self._http.built(records.answer_of, found))

    def query_batch(self, collection: str, queries: Sequence[Mapping[str, Any]]) -> list[Answer | ServiceError]:
        """Several queries by shape, each like ``{"shape": id, "k": 5}``: in their order an answer or its refusal."""
        body = {"queries": [dict(one) for one in queries]}

        def outcomes(found: Mapping[str, Any]) -> list[Answer | ServiceError]:
            return [records.outcome_of(one) for one in found["results"]]

        return self._get(outcomes, _collection(collection) + "/queries", method="POST", reads=True, json=body)

    # -- denoising

    def denoise(
        self, source: Source, method: str = "auto", iterations: int = 1, *, boundary: str = "curve",
        parameters: Mapping[str, Any] | None = None, truth: Source | None = None, format: str | None = None,
        wait: float = 600.0,
    ) -> Denoised:  # fmt: skip
        """Denoise a mesh that is not kept in a collection; ``denoised`` gives the resulting mesh.

        method, iterations, boundary, parameters: as of ``reebase.denoise``. truth: a mesh with the same faces, for
        the errors before and after. format: of the source, where content and file name do not tell.
        Raises ServiceError: ``unknown_name``, ``invalid_parameter``, and what an upload may; TaskFailed, WaitTimeout.
        """
        end = time.monotonic() + wait
        form = _given({
            "method": method, "iterations": iterations, "boundary": boundary, "format": format,
            "parameters": json.dumps(dict(parameters or {})), "wait": min(max(wait, 0.0), self._poll),
        })  # fmt: skip
        with ExitStack() as stack:
            files = {"file": stack.enter_context(_opened(source, None))}
            if truth is not None:
                files["truth"] = stack.enter_context(_opened(truth, None))
            reply = self._http.request("POST", "/v1/denoise", creates=True, data=form, files=files)
        found = self._http.object_of(reply)
        if reply.status_code == httpx.codes.ACCEPTED:
            task = self._http.built(lambda values: records.task_of(values["task"]), found)
            self.wait(task, timeout=end - time.monotonic())
            return self._get(records.denoised_of, f"/v1/denoise/{_segment(task.id)}")
        return cast(Denoised, self._http.built(records.denoised_of, found))

    def denoised(self, task: Denoised | str) -> Mesh:
        """The mesh that a request for denoising gave."""
        return read(self.denoised_bytes(task, format="ply"), "ply")

    def denoised_bytes(self, task: Denoised | str, *, format: str = "ply") -> bytes:
        """The same as a file: ply, glb, obj, stl or off. PLY and GLB carry ``displacement``."""
        identifier = task if isinstance(task, str) else task.task
        path = f"/v1/denoise/{_segment(identifier)}/mesh"
        return self._http.request("GET", path, params={"format": format}).content

    # -- tasks

    def task(self, task: str, *, wait: float = 0.0) -> Task:
        """A task; with ``wait`` once it has ended, or after so many seconds (60 at most)."""
        return self._get(records.task_of, f"/v1/tasks/{_segment(task)}", params={"wait": wait} if wait > 0 else {})

    def tasks(
        self, *, state: str | None = None, kind: str | None = None, collection: str | None = None,
        shape: str | None = None,
    ) -> Iterator[Task]:  # fmt: skip
        """Tasks, newest first; those that have all that is given."""
        filters = _given({"state": state, "kind": kind, "collection": collection, "shape": shape})
        return self._pages(records.task_of, "/v1/tasks", filters)

    def cancel(self, task: str) -> Task:
        """Cancel a task; a running one stops as soon as its worker hears of it.

        Raises ServiceError: ``task_not_cancellable`` when it has ended.
        """
        return self._get(records.task_of, f"/v1/tasks/{_segment(task)}/cancel", method="POST")

    def retry(self, task: str) -> Task:
        """Queue a failed or cancelled task again. Raises ServiceError: ``task_not_retryable``."""
        return self._get(records.task_of, f"/v1/tasks/{_segment(task)}/retry", method="POST")

    def wait(self, task: Task | str | None, *, timeout: float = 600.0) -> Task:
        """The task once it succeeded.

        Raises TaskFailed when it fails or is cancelled, WaitTimeout after ``timeout`` seconds.
        """
        if task is None:
            raise ParameterError("There is no task to wait for.", parameter="task")
        identifier = task if isinstance(task, str) else task.id
        end = time.monotonic() + timeout
        while True:
            began = time.monotonic()
            now = self.task(identifier, wait=min(max(end - began, 0.0), self._poll))
            if now.state == "succeeded":
                return now
            if now.ended:
                raise TaskFailed(now)
            if time.monotonic() >= end:
                raise WaitTimeout(f"Task {identifier} is still {now.state} after {timeout:g} seconds; it goes on.")
            # A service that stops answers long polls at once.
            time.sleep(max(0.0, 0.1 - (time.monotonic() - began)))

    # -- evaluations

    def start_evaluation(
        self, *, collection: str | None = None, synthetic: Mapping[str, Any] | None = None,
        profile: Mapping[str, Any] | None = None, descriptor: str = "srg", measure: str | None = None,
        rerank: bool | None = None, bootstrap: int = 1000,
    ) -> Evaluation:  # fmt: skip
        """Start an evaluation of a collection with labels, or of the synthetic set.

        synthetic: its options, as ``{"per_class": 25, "seed": 0}``; profile: of the pipeline, for the synthetic set.
        Then ``wait(evaluation.task)`` and ``evaluation(evaluation.id).report``.
        Raises ServiceError: ``validation_error``, ``unknown_name``, ``collection_not_found``.
        """
        body = _given({
            "collection": collection, "synthetic": None if synthetic is None else dict(synthetic),
            "profile": None if profile is None else dict(profile), "descriptor": descriptor, "measure": measure,
            "rerank": rerank, "bootstrap": bootstrap,
        })  # fmt: skip
        return self._get(records.evaluation_of, "/v1/evaluations", method="POST", creates=True, json=body)

    def evaluations(self) -> Iterator[Evaluation]:
        """Evaluations, newest first."""
        return self._pages(records.evaluation_of, "/v1/evaluations", {})

    def evaluation(self, evaluation: str) -> Evaluation:
        """An evaluation with its task and, once that succeeded, its report."""
        return self._get(records.evaluation_of, f"/v1/evaluations/{_segment(evaluation)}")

    def plot(self, evaluation: str, plot: str, *, theme: str = "light") -> bytes:
        """A plot as SVG: ``precision_recall``, ``matrix`` or ``confusion``. theme: ``light`` or ``dark``.

        Raises ServiceError: ``result_not_found`` until the evaluation succeeded.
        """
        path = f"/v1/evaluations/{_segment(evaluation)}/plots/{_segment(plot)}.svg"
        return self._http.request("GET", path, params={"theme": theme}).content

    def matrix(self, evaluation: str) -> Matrix:
        """The dissimilarity matrix. Raises ServiceError: ``result_not_found`` until the evaluation succeeded."""

        def made(found: Mapping[str, Any]) -> Matrix:
            return Matrix(tuple(found["items"]), np.array(found["matrix"], dtype=np.float64))

        return self._get(made, f"/v1/evaluations/{_segment(evaluation)}/matrix")

    def delete_evaluation(self, evaluation: str) -> None:
        """Delete an evaluation, its matrix and its task, which stops if it runs."""
        self._http.request("DELETE", f"/v1/evaluations/{_segment(evaluation)}")

    # -- the service

    def limits(self) -> ServiceLimits:
        """What a request may hold."""
        return self._get(lambda found: records.record(ServiceLimits, found), "/v1/limits")

    def formats(self) -> Formats:
        """What can be uploaded, and what meshes are given back in."""

        def made(found: Mapping[str, Any]) -> Formats:
            return Formats({one["name"]: one["media_type"] for one in found["items"]}, tuple(found["written"]))

        return self._get(made, "/v1/formats")

    def measures(self) -> list[Measure]:
        """The measures of D that a query or an evaluation can name."""
        return self._get(lambda found: [records.record(Measure, one) for one in found["items"]], "/v1/measures")

    def descriptors(self) -> list[Descriptor]:
        """What a query or an evaluation can name as descriptor."""

        def made(found: Mapping[str, Any]) -> list[Descriptor]:
            return [records.record(Descriptor, one, default=one["name"] == found["default"]) for one in found["items"]]

        return self._get(made, "/v1/descriptors")

    def coverage(self, collection: str) -> Coverage:
        """Of how many shapes each descriptor is kept."""

        def made(found: Mapping[str, Any]) -> Coverage:
            return Coverage(found["described"], {one["name"]: one["shapes"] for one in found["items"]})

        return self._get(made, _collection(collection) + "/descriptors")

    def reindex(self, collection: str, descriptors: Sequence[str] = ()) -> int:
        """Queue the shapes that lack a descriptor which the service keeps, or one of these; how many that are."""
        path, body = _collection(collection) + "/reindex", {"descriptors": list(descriptors)}
        return self._get(lambda found: int(found["queued"]), path, method="POST", reads=True, json=body)

    def find_duplicates(self, collection: str) -> Task:
        """Have near-duplicates sought; the task that does it, or did it when nothing changed since."""
        return self._get(records.task_of, _collection(collection) + "/duplicates", method="POST", reads=True)

    def duplicates(self, collection: str, *, shape: str | None = None, confidence: str = "fair", limit: int = 1000
                   ) -> Duplicates:  # fmt: skip
        """What the latest search found, the strongest first; nothing is ever deleted because of it.

        shape: only findings with this one. confidence: ``certain``, ``strong`` or ``fair``, the least to be told.
        """
        asked = _given({"shape": shape, "confidence": confidence, "limit": limit})
        return self._get(records.duplicates_of, _collection(collection) + "/duplicates", params=asked)

    def filters(self) -> list[Filter]:
        """The denoising filters that a profile can name."""
        return self._get(lambda found: [records.record(Filter, one) for one in found["items"]], "/v1/filters")

    def readiness(self) -> Readiness:
        """Whether it can serve, and when a worker was last seen. Raises ServiceError: ``not_ready``."""
        return self._get(lambda found: records.record(Readiness, found), "/readyz")

    def ready(self) -> bool:
        """Whether the service answers and can serve, asked once."""
        reply = self._http.answers()
        return reply is not None and reply.status_code == httpx.codes.OK

    # -- how

    def _get(
        self, make: Callable[[dict[str, Any]], _T], path: str, *, method: str = "GET", **arguments: Any
    ) -> _T:
        return cast(_T, self._http.built(make, self._http.json(method, path, **arguments)))

    def _pages(
        self, make: Callable[[dict[str, Any]], _T], path: str, filters: Mapping[str, Any]
    ) -> Iterator[_T]:
        parameters = {"limit": _PAGE, **filters}
        while True:
            page = self._http.json("GET", path, params=parameters)
            yield from self._http.built(lambda found: [make(one) for one in found["items"]], page)
            if not page.get("next"):
                return
            parameters["cursor"] = page["next"]


def _segment(value: str) -> str:
    """A name or id as one segment of a path."""
    if value in ("", ".", ".."):
        raise ParameterError(f"{value!r} is not a name or an id.", found=value)
    return quote(value, safe="")


def _collection(name: str) -> str:
    return f"/v1/collections/{_segment(name)}"


def _shape(collection: str, shape: str) -> str:
    return f"{_collection(collection)}/shapes/{_segment(shape)}"


def _given(values: Mapping[str, Any]) -> dict[str, Any]:
    """What is not None."""
    return {name: value for name, value in values.items() if value is not None}


@contextmanager
def _opened(source: Source, name: str | None) -> Iterator[tuple[str, bytes | IO[bytes]]]:
    """The file name and the content of what is sent; a file is left on disk and read as it goes out."""
    if isinstance(source, Mesh):
        yield name or "mesh.ply", to_bytes(source, "ply")
    elif isinstance(source, bytes):
        yield name or "mesh", source
    else:
        path = Path(source)
        with path.open("rb") as content:
            yield path.name.encode(errors="replace").decode(), content


def _skeleton_of(found: Mapping[str, Any]) -> Skeleton:
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


def _features_of(found: Mapping[str, Any]) -> npt.NDArray[np.float64]:
    return np.asarray(found["features"], dtype=np.float64).reshape(-1, 3)
