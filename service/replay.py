"""Idempotency-Key: the work and the record of its answer are one transaction, so a POST is done once."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any

from pydantic import BaseModel
from sqlalchemy import Connection
from starlette.requests import Request
from starlette.responses import Response

from service.auth import Principal
from service.context import Context
from store import idempotency
from store.sql import canonical_json

__all__ = ["REPLAYED", "json_response", "once", "same_request"]

REPLAYED = "Idempotency-Replayed"


def json_response(value: BaseModel, status: int = 200, headers: dict[str, str] | None = None) -> Response:
    """A response whose body is there at once, so that it can be kept."""
    return Response(value.model_dump_json(), status, headers, "application/json")


def same_request(
    request: Request, principal: Principal, key: str | None, body: Any
) -> idempotency.Request | None:
    """What makes a repetition of this request the same one; None without a key. body: a JSON value."""
    if key is None:
        return None
    fingerprint = hashlib.sha256(canonical_json(body).encode()).hexdigest()
    return idempotency.Request(key, principal.name, request.method, request.url.path, fingerprint)


def once(
    conn: Connection, context: Context, asked: idempotency.Request | None, work: Callable[[], Response]
) -> Response:
    """The response of ``work``, or the one that was given before. What ``work`` raises leaves no trace.

    Raises IdempotencyConflict when the key came with another request.
    """
    if asked is None:
        return work()
    given = idempotency.answer_to(conn, asked)
    if given is not None:
        return Response(given.body, given.status, {**given.headers, REPLAYED: "true"})
    response = work()
    kept = {name: response.headers[name] for name in ("content-type", "location") if name in response.headers}
    answer = idempotency.Answer(response.status_code, kept, bytes(response.body))
    idempotency.keep(conn, asked, answer, keep_seconds=context.settings.idempotency_seconds)
    return response
