"""Evaluations: a report on how well a labelled set is retrieved, and the task that computes it.

``create(conn, *, params, collection_id=None) -> Evaluation`` (queues its task), ``get(conn, id)``,
``of_task(conn, task_id)``, ``list_page(conn, *, limit, cursor, collection_id)``, ``delete(conn, id)``,
``complete(conn, task, report, *, items, matrix_sha256) -> Task`` (fenced; raises StaleClaim),
``matrix_of(evaluation) -> sha256``, ``matrix_rows(blobs, sha256) -> Iterator[ndarray]``

The matrix is a blob in npy format, put before ``complete``.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from sqlalchemy import Connection, Select, null, select
from sqlalchemy import delete as delete_from
from sqlalchemy import update as update_rows

from store import tasks
from store.blobs import Blobs
from store.errors import EvaluationNotFound, ResultNotFound
from store.records import Evaluation, Page, Task
from store.sql import cursor_after, id_of_cursor, insert, new_id, now
from store.tables import evaluation as table
from store.tables import task as task_table

__all__ = ["complete", "create", "delete", "get", "list_page", "matrix_of", "matrix_rows", "of_task"]

_LARGE = ("report", "items")


def create(conn: Connection, *, params: Mapping[str, Any], collection_id: str | None = None) -> Evaluation:
    """A new evaluation, whose task is queued. params: what is evaluated and how; the task has them too."""
    task = tasks.enqueue(conn, "evaluate", collection_id=collection_id, params=params)
    evaluation_id = new_id()
    values = {
        "id": evaluation_id, "task_id": task.id, "collection_id": collection_id, "params": dict(params),
        "created_at": now(),
    }  # fmt: skip
    conn.execute(insert(conn, table).values(values))
    return get(conn, evaluation_id)


def get(conn: Connection, evaluation_id: str) -> Evaluation:
    """Raises EvaluationNotFound."""
    return _one(conn, select(table).where(table.c.id == evaluation_id), evaluation_id)


def of_task(conn: Connection, task_id: str) -> Evaluation:
    """The evaluation that a task computes. Raises EvaluationNotFound."""
    return _one(conn, select(table).where(table.c.task_id == task_id), task_id)


def list_page(
    conn: Connection, *, limit: int = 100, cursor: str | None = None, collection_id: str | None = None
) -> Page[Evaluation]:
    """Newest first, without report and items: a page of them would have no bound. Raises InvalidCursor."""
    kept = (column for column in table.c if column.name not in _LARGE)
    query = select(*kept, *(null().label(name) for name in _LARGE))
    if collection_id is not None:
        query = query.where(table.c.collection_id == collection_id)
    if cursor is not None:
        query = query.where(table.c.id < id_of_cursor(cursor))
    found = _read(conn, query.order_by(table.c.id.desc()).limit(limit + 1))
    items = tuple(found[:limit])
    return Page(items, cursor_after(items[-1].id) if len(found) > limit else None)


def delete(conn: Connection, evaluation_id: str) -> Evaluation:
    """Deletes the evaluation and its task, which stops if it runs; the matrix is left to the sweep.

    Returns what it was. Raises EvaluationNotFound.
    """
    evaluation = get(conn, evaluation_id)
    conn.execute(delete_from(table).where(table.c.id == evaluation_id))
    conn.execute(delete_from(task_table).where(task_table.c.id == evaluation.task.id))
    return evaluation


def complete(
    conn: Connection,
    task: Task,
    report: Mapping[str, Any],
    *,
    items: Sequence[Mapping[str, Any]],
    matrix_sha256: str | None,
) -> Task:
    """Writes the report and ends the task. items: the rows of the matrix in order, id, name and label each.

    Raises StaleClaim when the claim is over; let it leave the transaction, so that nothing is written.
    """
    evaluation = of_task(conn, task.id)
    done = tasks.succeed(conn, task, {"evaluation": evaluation.id})
    values = {"report": dict(report), "items": [dict(item) for item in items], "matrix_sha256": matrix_sha256}
    conn.execute(update_rows(table).where(table.c.id == evaluation.id).values(values))
    return done


def matrix_of(evaluation: Evaluation) -> str:
    """The blob of the dissimilarity matrix. Raises ResultNotFound when there is none yet."""
    if evaluation.matrix_sha256 is None:
        raise ResultNotFound("The evaluation has no matrix yet; look at its task.", evaluation=evaluation.id)
    return evaluation.matrix_sha256


def matrix_rows(blobs: Blobs, sha256: str) -> Iterator[npt.NDArray[np.float64]]:
    """The dissimilarities of all pairs, one row (n,) at a time, in the order of ``evaluation.items``.

    Raises BlobNotFound at once.
    """
    return _rows(blobs.stream(sha256))


def _rows(pieces: Iterator[bytes]) -> Iterator[npt.NDArray[np.float64]]:
    """The rows of a two-dimensional array in npy format, version 1.0, that arrives in pieces."""
    start = io.BytesIO(next(pieces, b""))
    np.lib.format.read_magic(start)
    (_, columns), _, kind = np.lib.format.read_array_header_1_0(start)
    held, width = start.read(), columns * kind.itemsize
    while width:
        whole = len(held) // width * width
        for begin in range(0, whole, width):
            yield np.frombuffer(held, kind, columns, begin)
        following = next(pieces, b"")
        if not following:
            return
        held = held[whole:] + following


def _one(conn: Connection, query: Select[Any], given: str) -> Evaluation:
    found = _read(conn, query)
    if not found:
        raise EvaluationNotFound(f"There is no evaluation {given[:80]!r}.")
    return found[0]


def _read(conn: Connection, query: Select[Any]) -> list[Evaluation]:
    rows = conn.execute(query).mappings().all()
    wanted = select(task_table).where(task_table.c.id.in_([row["task_id"] for row in rows]))
    found = {row["id"]: tasks.task_of_row(row) for row in conn.execute(wanted).mappings()}
    own = [name for name in Evaluation.__dataclass_fields__ if name != "task"]
    return [Evaluation(**{name: row[name] for name in own}, task=found[row["task_id"]]) for row in rows]
