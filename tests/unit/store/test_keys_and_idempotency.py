"""API keys that are shown once, and requests that are done once."""

from __future__ import annotations

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
    IdempotencyInProgress,
    KeyNotFound,
    QuotaExceeded,
    StaleClaim,
)
from store.idempotency import Answer, Begun, Request
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


def begin(database: Database, request: Request = ASKED, **times: float) -> Begun | Answer:
    with database.write() as conn:
        return idempotency.begin(conn, request, **times)


def test_done_once_and_answered_alike(database: Database) -> None:
    begun = begin(database)
    assert isinstance(begun, Begun)
    with pytest.raises(IdempotencyInProgress):
        begin(database)
    with database.write() as conn:
        collections.create(conn, "ants")
        idempotency.complete(conn, begun, ANSWER)
    assert begin(database) == ANSWER == begin(database)
    with pytest.raises(IdempotencyConflict):
        begin(database, Request(**{**ASKED.__dict__, "fingerprint": "0" * 64}))


@pytest.mark.parametrize("other", [{"principal": "key"}, {"method": "PUT"}, {"path": "/v1/x"}, {"key": "k2"}])
def test_others_have_their_own_keys(database: Database, other: dict[str, str]) -> None:
    begin(database)
    assert isinstance(begin(database, Request(**{**ASKED.__dict__, **other})), Begun)


def test_a_request_that_was_refused_frees_its_key(database: Database) -> None:
    begun = begin(database)
    assert isinstance(begun, Begun)
    with database.write() as conn:
        idempotency.abandon(conn, begun)
    assert isinstance(begin(database), Begun)


def test_a_request_that_died_is_taken_over_and_cannot_come_back(database: Database) -> None:
    dead = begin(database, lock_seconds=-1)
    assert isinstance(dead, Begun)
    with pytest.raises(IdempotencyConflict):
        begin(database, Request(**{**ASKED.__dict__, "fingerprint": "0" * 64}))
    second = begin(database)
    assert isinstance(second, Begun)
    with pytest.raises(StaleClaim), database.write() as conn:
        collections.create(conn, "ants")
        idempotency.complete(conn, dead, ANSWER)
    with database.write() as conn:
        idempotency.abandon(conn, dead)
        collections.create(conn, "ants")
        idempotency.complete(conn, second, ANSWER)
    assert begin(database) == ANSWER


def test_answers_expire(database: Database) -> None:
    begun = begin(database)
    assert isinstance(begun, Begun)
    table = tables.idempotency
    with database.write() as conn:
        idempotency.complete(conn, begun, ANSWER)
        assert idempotency.purge(conn) == 0
        conn.execute(update(table).values(expires_at=now(-1)))
    assert isinstance(begin(database, Request(**{**ASKED.__dict__, "fingerprint": "0" * 64})), Begun)
    with database.write() as conn:
        conn.execute(update(table).values(expires_at=now(-1)))
        # It is being answered.
        assert idempotency.purge(conn) == 0
        conn.execute(update(table).values(locked_until=now(-1)))
        assert idempotency.purge(conn) == 1
        assert conn.execute(select(table)).all() == []


def test_an_answer_is_whole_or_not_there(database: Database) -> None:
    begin(database)
    with pytest.raises(IntegrityError), database.write() as conn:
        conn.execute(update(tables.idempotency).values(status=200))
