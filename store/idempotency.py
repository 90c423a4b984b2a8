"""Idempotency keys: a POST that is sent twice is done once, and answered twice alike.

``begin(conn, request, *, keep_seconds, lock_seconds) -> Begun | Answer``: do the work, or send the answer
``complete(conn, begun, answer)``: in the transaction of the work itself where there is one
``abandon(conn, begun)``: the work was refused, so the key is free again
``Request(key, principal, method, path, fingerprint)``

A process that dies while it answers leaves a lock that ends by itself; what it committed together with
``complete`` is answered, what it had not committed is done again.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from sqlalchemy import ColumnElement, Connection, and_, delete, or_, select, update

from store.errors import IdempotencyConflict, IdempotencyInProgress, StaleClaim
from store.sql import insert, new_id, now
from store.tables import idempotency as table

__all__ = ["Answer", "Begun", "Request", "abandon", "begin", "complete", "purge"]


@dataclass(frozen=True)
class Request:
    """What makes two requests the same. fingerprint: a hash of the body and whatever else matters."""

    key: str
    principal: str
    method: str
    path: str
    fingerprint: str


@dataclass(frozen=True)
class Begun:
    """The right to answer a request."""

    request: Request
    holder: str


@dataclass(frozen=True)
class Answer:
    """What was answered, to be sent again as it was."""

    status: int
    headers: dict[str, str] = field(default_factory=dict)
    body: bytes = b""


def begin(
    conn: Connection, request: Request, *, keep_seconds: float = 86400.0, lock_seconds: float = 120.0
) -> Begun | Answer:
    """The right to answer, or the answer that was given.

    Raises IdempotencyConflict when the key came with another request, IdempotencyInProgress while the first
    request is being answered, for ``lock_seconds`` at most.
    """
    purge(conn, request)
    holder = new_id()
    values = {
        "key": request.key, "principal": request.principal, "method": request.method, "path": request.path,
        "fingerprint": request.fingerprint, "holder": holder, "locked_until": now(lock_seconds),
        "expires_at": now(keep_seconds),
    }  # fmt: skip
    free = insert(conn, table).values(values).on_conflict_do_nothing().returning(table.c.holder)
    if conn.execute(free).scalar() is not None:
        return Begun(request, holder)
    dead = (table.c.locked_until < now()).label("dead")
    row = conn.execute(select(table, dead).where(_same(request))).one()
    if row.fingerprint != request.fingerprint:
        raise IdempotencyConflict(key=request.key)
    if row.status is not None:
        return Answer(row.status, row.headers, row.body)
    if not row.dead:
        raise IdempotencyInProgress(key=request.key)
    conn.execute(update(table).where(_same(request)).values(holder=holder, locked_until=now(lock_seconds)))
    return Begun(request, holder)


def complete(conn: Connection, begun: Begun, answer: Answer) -> None:
    """Keeps the answer. Raises StaleClaim when the lock ended and another request took it."""
    kept = {"status": answer.status, "headers": answer.headers, "body": answer.body}
    mine = and_(_same(begun.request), table.c.holder == begun.holder)
    done = conn.execute(update(table).where(mine).values(**kept, holder=None, locked_until=None))
    if not done.rowcount:
        raise StaleClaim("Another request with this Idempotency-Key took over, so this one was not kept.")


def abandon(conn: Connection, begun: Begun) -> None:
    """Frees the key; nothing happens when the lock was lost."""
    conn.execute(delete(table).where(_same(begun.request), table.c.holder == begun.holder))


def purge(conn: Connection, request: Request | None = None) -> int:
    """Removes what has expired, of one request or of all; says how many."""
    # Not what is being answered, however long that takes.
    ended = and_(table.c.expires_at < now(), or_(table.c.holder.is_(None), table.c.locked_until < now()))
    which = ended if request is None else and_(ended, _same(request))
    return conn.execute(delete(table).where(which)).rowcount


def _same(request: Request) -> ColumnElement[bool]:
    return and_(*(table.c[name] == getattr(request, name) for name in ("key", "principal", "method", "path")))
