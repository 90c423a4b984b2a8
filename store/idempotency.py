"""Idempotency keys: a POST that is sent twice is done once, and answered twice alike.

``answer_to(conn, request) -> Answer | None``: what was answered, or do the work
``keep(conn, request, answer, *, keep_seconds)``
``Request(key, principal, method, path, fingerprint)``

Both in the write transaction of the work itself: what dies on the way leaves nothing behind and is done again.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from sqlalchemy import ColumnElement, Connection, and_, delete, select

from store.errors import IdempotencyConflict
from store.sql import insert, now
from store.tables import idempotency as table

__all__ = ["Answer", "Request", "answer_to", "keep", "purge"]


@dataclass(frozen=True)
class Request:
    """What makes two requests the same. fingerprint: a hash of the body and whatever else matters."""

    key: str
    principal: str
    method: str
    path: str
    fingerprint: str


@dataclass(frozen=True)
class Answer:
    """What was answered, to be sent again as it was."""

    status: int
    headers: dict[str, str] = field(default_factory=dict)
    body: bytes = b""


def answer_to(conn: Connection, request: Request) -> Answer | None:
    """The answer that was given, None when the work is still to be done. Raises IdempotencyConflict."""
    purge(conn, request)
    row = conn.execute(select(table).where(_same(request))).first()
    if row is None:
        return None
    if row.fingerprint != request.fingerprint:
        raise IdempotencyConflict(key=request.key)
    return Answer(row.status, row.headers, row.body)


def keep(conn: Connection, request: Request, answer: Answer, *, keep_seconds: float = 86400.0) -> None:
    """Keeps the answer to a request that has none yet."""
    values = {
        "key": request.key, "principal": request.principal, "method": request.method, "path": request.path,
        "fingerprint": request.fingerprint, "status": answer.status, "headers": answer.headers,
        "body": answer.body, "expires_at": now(keep_seconds),
    }  # fmt: skip
    conn.execute(insert(conn, table).values(values))


def purge(conn: Connection, request: Request | None = None) -> int:
    """Removes what has expired, of one request or of all; says how many."""
    ended = table.c.expires_at < now()
    which = ended if request is None else and_(ended, _same(request))
    return conn.execute(delete(table).where(which)).rowcount


def _same(request: Request) -> ColumnElement[bool]:
    return and_(*(table.c[name] == getattr(request, name) for name in ("key", "principal", "method", "path")))
