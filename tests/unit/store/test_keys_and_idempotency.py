"""API keys that are shown once, and requests that are done once."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable

import pytest
from sqlalchemy import select, update
from sqlalchemy.exc import IntegrityError

from reebase.errors import ParameterError, UnknownName
from store import collections, idempotency, keys, shapes, tables
from store.engine import Database
from store.errors import (
    CollectionNotFound,
    IdempotencyConflict,
    KeyNotFound,
    QuotaExceeded,
)
from store.idempotency import Answer, Request
from store.records import Collection, Shape, Task
from store.sql import now

ASKED = Request("k1", "anonymous", "POST", "/v1/collections", "f" * 64)
ANSWER = Answer(201, {"location": "/v1/collections/ants"}, b'{"name":"ants"}')


def test_a_secret_opens_and_is_kept_nowhere(database: Database, collection: Collection) -> None:
    with database.write() as conn:
        assert not keys.any_active(conn)
        key, secret = keys.create(conn, "write", "ants", "ci", requests_per_minute=60, max_shapes=10)
    assert re.fullmatch(r"rb_[A-Za-z0-9_-]{43}", secret)
    assert secret.startswith(key.prefix) and len(key.prefix) == 11
    assert (key.scope, key.collection, key.collection_id) == ("write", "ants", collection.id)
    assert (key.name, key.requests_per_minute, key.max_shapes) == ("ci", 60, 10)
    with database.read() as conn:
        assert keys.verify(conn, secret) == key == keys.get(conn, key.id)
        assert keys.list_all(conn) == [key]
        for wrong in (secret[:-1], secret + "x", secret.upper(), "", "rb_", "ü"):
            assert keys.verify(conn, wrong) is None
    assert secret.encode() not in database.path.read_bytes()
    wal = database.path.with_name(f"{database.path.name}-wal")
    assert secret.encode() not in wal.read_bytes()


def test_revoking_ends_a_key(database: Database) -> None:
    with database.write() as conn:
        key, secret = keys.create(conn, "admin")
        assert keys.any_active(conn)
        keys.used(conn, key.id)
        revoked = keys.revoke(conn, key.id)
        assert keys.revoke(conn, key.id) == revoked
        assert revoked.revoked_at is not None and revoked.last_used_at is not None
        assert keys.verify(conn, secret) is None
        assert not keys.any_active(conn)
        assert keys.list_all(conn) == [revoked]
        with pytest.raises(KeyNotFound):
            keys.revoke(conn, "nothing")


def test_a_key_goes_with_its_collection(database: Database, collection: Collection) -> None:
    with database.write() as conn:
        _, secret = keys.create(conn, "read", "ants")
        collections.delete(conn, "ants")
        assert keys.verify(conn, secret) is None


def test_keys_that_make_no_sense(database: Database, collection: Collection) -> None:
    with database.write() as conn:
        with pytest.raises(UnknownName, match="read, write, admin"):
            keys.create(conn, "root")
        with pytest.raises(CollectionNotFound):
            keys.create(conn, "read", "bees")
        with pytest.raises(ParameterError):
            keys.create(conn, "admin", "ants")
        with pytest.raises(ParameterError):
            keys.create(conn, "read", requests_per_minute=0)
        with pytest.raises(ParameterError):
            keys.create(conn, "read", max_shapes=-1)
        with pytest.raises(KeyNotFound):
            keys.get(conn, "nothing")
        assert keys.list_all(conn) == []


def test_the_quota_counts_what_is_kept(
    database: Database, collection: Collection, upload: Callable[..., tuple[Shape, Task]]
) -> None:
    with database.write() as conn:
        key, _ = keys.create(conn, "write", max_shapes=2)
        unlimited, _ = keys.create(conn, "write")
    mine, _ = upload(owner=key.id)
    upload(owner=key.id)
    upload(owner=unlimited.id)
    with database.write() as conn:
        with pytest.raises(QuotaExceeded):
            keys.check_quota(conn, key)
        keys.check_quota(conn, key, adding=0)
        keys.check_quota(conn, unlimited, adding=10**6)
        shapes.delete(conn, collection.id, mine.id)
        keys.check_quota(conn, key)


def answered(database: Database, request: Request = ASKED) -> Answer | None:
    with database.write() as conn:
        return idempotency.answer_to(conn, request)


def test_done_once_and_answered_alike(database: Database) -> None:
    assert answered(database) is None
    with database.write() as conn:
        idempotency.keep(conn, ASKED, ANSWER)
    assert answered(database) == ANSWER == answered(database)
    with pytest.raises(IdempotencyConflict):
        answered(database, dataclasses.replace(ASKED, fingerprint="0" * 64))


@pytest.mark.parametrize("other", [{"principal": "key"}, {"method": "PUT"}, {"path": "/v1/x"}, {"key": "k2"}])
def test_others_have_their_own_keys(database: Database, other: dict[str, str]) -> None:
    with database.write() as conn:
        idempotency.keep(conn, ASKED, ANSWER)
    assert answered(database, dataclasses.replace(ASKED, **other)) is None


def test_answers_expire(database: Database) -> None:
    with database.write() as conn:
        idempotency.keep(conn, ASKED, ANSWER)
        assert idempotency.purge(conn) == 0
        conn.execute(update(tables.idempotency).values(expires_at=now(-1)))
    assert answered(database, dataclasses.replace(ASKED, fingerprint="0" * 64)) is None
    with database.write() as conn:
        idempotency.keep(conn, ASKED, ANSWER, keep_seconds=-1)
        assert idempotency.purge(conn) == 1
        assert conn.execute(select(tables.idempotency)).all() == []


def test_an_answer_is_whole_or_not_there(database: Database) -> None:
    with pytest.raises(IntegrityError), database.write() as conn:
        idempotency.keep(conn, ASKED, ANSWER)
        conn.execute(update(tables.idempotency).values(status=None))
