"""The sweep: removes what nothing needs any more.

``sweep(database, blobs, settings) -> Swept``: run it now and then, from one process or several at once.
``remove_unnamed(database, blobs, sha256, grace_seconds) -> bool``: one blob, as when the task of a query ended.
``referenced(conn, hashes) -> set``, ``all_referenced(conn) -> set``: which blobs rows name.

A blob is removed when no row names it and it was not put within the grace period. Blobs are put before
the rows that name them, so the last look at the rows happens inside the write lock, right before the
removal: a row that commits later belongs to a blob that was put, and so renewed, after that look or
within the grace.

The mesh of a query has no grace once its task ended. Whoever puts the same bytes after that task was
queued renews them, which spares them; who put them earlier and has not named them yet finds them gone
in the transaction that would name them, and is told to send them again.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any

from sqlalchemy import ColumnElement, Connection, and_, delete, exists, func, or_, select, true, update

from store import idempotency, shapes
from store.blobs import Blobs
from store.engine import Database
from store.settings import Settings
from store.sql import now, read_clock
from store.tables import evaluation, revision, shape, skeleton, task, task_output, tombstone

__all__ = ["Swept", "all_referenced", "referenced", "remove_unnamed", "sweep"]

_MANY = 500  # hashes in one statement
_CLOCK_SECONDS = 0.001  # what the database's clock may be off by

_NAMES: tuple[tuple[Any, ColumnElement[bool]], ...] = (
    (shape.c.sha256, true()),
    (skeleton.c.cleaned_sha256, true()),
    (skeleton.c.denoised_sha256, true()),
    (skeleton.c.thumbnail_sha256, true()),
    (skeleton.c.display_sha256, true()),
    (evaluation.c.matrix_sha256, true()),
    (task_output.c.sha256, true()),
    # The mesh of a query is kept no longer than its task lives.
    (task.c.blob, task.c.state.in_(("queued", "running"))),
)
"""Every column that names a blob, and when."""

_KEPT = ("describe", "evaluate")
"""Kinds of tasks whose record stays as long as what they were about; the others are answers to one question."""


@dataclass(frozen=True)
class Swept:
    """How much of each was removed."""

    blobs: int
    unfinished_uploads: int
    idempotency_keys: int
    tasks: int
    tombstones: int
    shapes: int


def sweep(database: Database, blobs: Blobs, settings: Settings) -> Swept:
    """Removes unnamed blobs, dead uploads, expired idempotency keys, old tombstones, shapes that were
    deleted too long ago to be restored, and old tasks: queries, and descriptions of shapes that are gone.
    """
    with database.write() as conn:
        purged = shapes.purge(conn, settings.keep_deleted_seconds)
        keys = idempotency.purge(conn)
        tasks = _purge_tasks(conn, settings.keep_query_seconds)
        tombstones = _purge_tombstones(conn, settings.keep_tombstones_seconds)
    grace = settings.sweep_grace_seconds
    removed = sum(remove_unnamed(database, blobs, sha256, grace) for sha256 in _unnamed(database, blobs))
    return Swept(removed, blobs.clear_unfinished(grace_seconds=grace), keys, tasks, tombstones, purged)


def referenced(conn: Connection, hashes: Iterable[str]) -> set[str]:
    """Those of the hashes that some row names."""
    found: set[str] = set()
    for batch in _batches(hashes):
        for column, when in _NAMES:
            found.update(conn.execute(select(column).where(column.in_(batch), when)).scalars())
    return found


def all_referenced(conn: Connection) -> set[str]:
    """Every blob that some row names."""
    found: set[str] = set()
    for column, when in _NAMES:
        found.update(conn.execute(select(column).where(column.is_not(None), when)).scalars())
    return found


def _unnamed(database: Database, blobs: Blobs) -> Iterator[str]:
    for batch in _batches(blobs.all()):
        with database.read() as conn:
            named = referenced(conn, batch)
        yield from (sha256 for sha256 in batch if sha256 not in named)


def remove_unnamed(database: Database, blobs: Blobs, sha256: str, grace_seconds: float) -> bool:
    """Removes a blob that no row names and that is old enough; says whether it did."""
    with database.write() as conn:
        if referenced(conn, [sha256]):
            return False
        asked = conn.execute(select(func.max(task.c.created_at)).where(task.c.blob == sha256)).scalar()
        if asked is not None:  # by a query that ended: only what was put after it was queued is another's
            since = (read_clock(conn) - asked).total_seconds() - _CLOCK_SECONDS
            grace_seconds = min(grace_seconds, max(0.0, since))
        return blobs.delete(sha256, grace_seconds=grace_seconds)


def _purge_tasks(conn: Connection, keep_seconds: float) -> int:
    gone = and_(task.c.kind == "describe", ~exists().where(shape.c.id == task.c.shape_id))
    old = and_(or_(task.c.kind.not_in(_KEPT), gone), task.c.finished_at < now(-keep_seconds))
    return conn.execute(delete(task).where(old)).rowcount


def _purge_tombstones(conn: Connection, keep_seconds: float) -> int:
    old = tombstone.c.deleted_at < now(-keep_seconds)
    last = conn.execute(select(func.max(tombstone.c.revision)).where(old)).scalar()
    if last is None:
        return 0
    # Up to a revision, not by age alone: the floor must tell exactly what is missing.
    conn.execute(update(revision).values(floor=last))
    return conn.execute(delete(tombstone).where(tombstone.c.revision <= last)).rowcount


def _batches(hashes: Iterable[str]) -> Iterator[list[str]]:
    rest = iter(hashes)
    while batch := list(islice(rest, _MANY)):
        yield batch
