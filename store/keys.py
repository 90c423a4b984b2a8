"""API keys: random secrets that are shown once and kept as hashes.

``create(conn, scope, collection=None, name="", *, requests_per_minute, max_shapes) -> (ApiKey, secret)``,
``verify(conn, secret) -> ApiKey | None``, ``get(conn, key_id)``, ``list_all(conn)``,
``revoke(conn, key_id)``, ``used(conn, key_id)``, ``any_active(conn) -> bool``,
``check_quota(conn, key, adding=1)``

A secret is ``rb_`` and 256 random bits; with so many, a plain SHA-256 is as good as a slow hash.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from typing import Any

from sqlalchemy import Connection, Select, exists, func, select, update

from reebase.errors import ParameterError, UnknownName
from store import collections
from store.errors import KeyNotFound, QuotaExceeded
from store.records import ApiKey
from store.sql import insert, new_id, now
from store.tables import api_key as table
from store.tables import collection as collection_table
from store.tables import present, shape

__all__ = ["SCOPES", "any_active", "check_quota", "create", "get", "list_all", "revoke", "used", "verify"]

SCOPES = ("read", "write", "admin")
"""Each allows what the ones before it allow."""

_SHOWN = 11  # "rb_" and 48 bits: enough to tell keys apart, 208 bits stay secret


def create(
    conn: Connection,
    scope: str,
    collection: str | None = None,
    name: str = "",
    *,
    requests_per_minute: int | None = None,
    max_shapes: int | None = None,
) -> tuple[ApiKey, str]:
    """A new key and its secret, which cannot be had again. collection: the name of the only one it opens.

    Raises UnknownName for a scope, CollectionNotFound, ParameterError.
    """
    if scope not in SCOPES:
        raise UnknownName(
            f"There is no scope {scope!r}; the choices are {', '.join(SCOPES)}.",
            parameter="scope", found=scope, choices=list(SCOPES),
        )  # fmt: skip
    if scope == "admin" and collection is not None:
        raise ParameterError("An admin key opens everything, so it takes no collection.", parameter="collection")
    if requests_per_minute is not None and requests_per_minute < 1:
        raise ParameterError("requests_per_minute must be at least 1.", parameter="requests_per_minute")
    if max_shapes is not None and max_shapes < 0:
        raise ParameterError("max_shapes must be at least 0.", parameter="max_shapes")
    secret = f"rb_{secrets.token_urlsafe(32)}"
    key_id = new_id()
    values = {
        "id": key_id, "name": name, "hash": _hash(secret), "prefix": secret[:_SHOWN], "scope": scope,
        "collection_id": collections.get(conn, collection).id if collection is not None else None,
        "requests_per_minute": requests_per_minute, "max_shapes": max_shapes, "created_at": now(),
    }  # fmt: skip
    conn.execute(insert(conn, table).values(values))
    return get(conn, key_id), secret


def verify(conn: Connection, secret: str) -> ApiKey | None:
    """The key of this secret, None when there is none or it was revoked."""
    # Found by its hash: how long that takes tells nothing about a secret that is not known whole.
    digest = _hash(secret)
    row = conn.execute(_keys().where(table.c.hash == digest)).mappings().first()
    if row is None or not hmac.compare_digest(row["hash"], digest) or row["revoked_at"] is not None:
        return None
    return _record(row)


def get(conn: Connection, key_id: str) -> ApiKey:
    """Raises KeyNotFound."""
    row = conn.execute(_keys().where(table.c.id == key_id)).mappings().first()
    if row is None:
        raise KeyNotFound(f"There is no API key {key_id[:80]!r}.")
    return _record(row)


def list_all(conn: Connection) -> list[ApiKey]:
    """All keys, the revoked ones too, oldest first."""
    return [_record(row) for row in conn.execute(_keys().order_by(table.c.id)).mappings()]


def revoke(conn: Connection, key_id: str) -> ApiKey:
    """Ends a key; it stays listed. Revoking twice changes nothing. Raises KeyNotFound."""
    conn.execute(update(table).where(table.c.id == key_id, table.c.revoked_at.is_(None)).values(revoked_at=now()))
    return get(conn, key_id)


def used(conn: Connection, key_id: str) -> None:
    """Notes that the key was used. A caller does this now and then, not for every request."""
    conn.execute(update(table).where(table.c.id == key_id).values(last_used_at=now()))


def any_active(conn: Connection) -> bool:
    """Whether there is a key that is not revoked."""
    return bool(conn.execute(select(exists().where(table.c.revoked_at.is_(None)))).scalar_one())


def check_quota(conn: Connection, key: ApiKey, adding: int = 1) -> None:
    """Raises QuotaExceeded when the shapes that this key uploaded and so many more exceed its quota.

    Call it in the transaction that adds them, so that two uploads cannot both take the last place.
    """
    if key.max_shapes is None:
        return
    count = conn.execute(select(func.count()).where(shape.c.owner == key.id, present)).scalar_one()
    if count + adding > key.max_shapes:
        raise QuotaExceeded(
            f"This API key may keep {key.max_shapes} shapes and keeps {count}; delete some first.",
            limit=key.max_shapes, found=count,
        )  # fmt: skip


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()


def _keys() -> Select[Any]:
    named = collection_table.c.name.label("collection")
    return select(table, named).outerjoin(collection_table, collection_table.c.id == table.c.collection_id)


def _record(row: Any) -> ApiKey:
    return ApiKey(**{name: row[name] for name in ApiKey.__dataclass_fields__})
