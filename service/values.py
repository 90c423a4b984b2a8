"""From the store's records to what goes over the wire."""

from __future__ import annotations

from collections.abc import Iterable

from sqlalchemy import Connection

from service.schemas.collections import CollectionValue, Counts
from service.schemas.common import ErrorValue, Progress
from service.schemas.evaluations import EvaluationValue
from service.schemas.shapes import ShapeValue
from service.schemas.tasks import TaskValue
from store import collections, shapes, tasks
from store.errors import NotFound
from store.records import Collection, Evaluation, Shape, Task

__all__ = ["collection_value", "error_value", "evaluation_value", "shape_value", "shape_values", "task_value",
           "task_values"]  # fmt: skip

_RESULTS_ELSEWHERE = ("describe", "duplicates", "evaluate", "map")
"""Kinds of tasks whose results are read where they belong."""



def collection_value(conn: Connection, collection: Collection) -> CollectionValue:
    """A collection with its counts."""
    counts = collections.counts(conn, collection.id)
    return CollectionValue(
        name=collection.name, description=collection.description, profile=collection.profile,
        profile_key=collection.profile_key, created_at=collection.created_at,
        updated_at=collection.updated_at,
        counts=Counts(
            shapes=counts.shapes, states=counts.by_state,
            endpoints={str(count): shapes for count, shapes in counts.by_endpoint_count.items()},
        ),
    )  # fmt: skip


def error_value(task: Task) -> ErrorValue | None:
    """Why a task failed, None when it did not."""
    if task.error_code is None:
        return None
    details = dict(task.error_detail or {})
    message = str(details.pop("message", task.error_code))
    return ErrorValue(code=task.error_code, detail=message, details=details or None)


def shape_values(conn: Connection, collection: Collection, shapes: Iterable[Shape]) -> list[ShapeValue]:
    """Shapes of one collection; a failed one says why."""
    return [shape_value(conn, collection, shape) for shape in shapes]


def shape_value(conn: Connection, collection: Collection, shape: Shape) -> ShapeValue:
    error = None
    if shape.state == "failed" and shape.task_id is not None:
        error = error_value(tasks.get(conn, shape.task_id))
    return ShapeValue(
        id=shape.id, collection=collection.name, name=shape.name, label=shape.label, tags=list(shape.tags),
        metadata=shape.metadata, state=shape.state, sha256=shape.sha256, bytes=shape.bytes,
        format=shape.format, filename=shape.filename, endpoint_count=shape.endpoint_count, flags=list(shape.flags),
        thumbnail=_thumbnail(collection, shape),
        task=shape.task_id, error=error, created_at=shape.created_at, updated_at=shape.updated_at,
    )  # fmt: skip


def _thumbnail(collection: Collection, shape: Shape) -> str | None:
    if shape.thumbnail_sha256 is None:
        return None
    return f"/v1/collections/{collection.name}/shapes/{shape.id}/thumbnail?of={shape.thumbnail_sha256}"


def task_values(conn: Connection, found: Iterable[Task]) -> list[TaskValue]:
    """Tasks, with the names of their collections and shapes where these are still there."""
    found = list(found)
    there = shapes.by_ids(conn, filter(None, (task.shape_id for task in found)))
    names: dict[str, str | None] = {}
    values = []
    for task in found:
        if task.collection_id is not None and task.collection_id not in names:
            try:
                names[task.collection_id] = collections.by_id(conn, task.collection_id).name
            except NotFound:
                names[task.collection_id] = None
        shape = there.get(task.shape_id or "")
        values.append(_task_value(task, names.get(task.collection_id or ""), shape.name if shape else None))
    return values


def task_value(conn: Connection, task: Task) -> TaskValue:
    return task_values(conn, [task])[0]


def _task_value(task: Task, collection: str | None, shape_name: str | None) -> TaskValue:
    return TaskValue(
        id=task.id, kind=task.kind, state=task.state, collection=collection, shape=task.shape_id, shape_name=shape_name,
        progress=Progress(stage=task.stage, fraction=task.fraction), error=error_value(task),
        result=None if task.kind in _RESULTS_ELSEWHERE else task.result, attempt=task.attempt, crashes=task.crashes,
        cancel_requested=task.cancel_requested, created_at=task.created_at, started_at=task.started_at,
        finished_at=task.finished_at,
    )  # fmt: skip


def evaluation_value(conn: Connection, evaluation: Evaluation) -> EvaluationValue:
    matrix = None if evaluation.matrix_sha256 is None else f"/v1/evaluations/{evaluation.id}/matrix"
    return EvaluationValue(
        id=evaluation.id, task=task_value(conn, evaluation.task), request=evaluation.params,
        report=evaluation.report, matrix=matrix, created_at=evaluation.created_at,
    )  # fmt: skip
