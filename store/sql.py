"""What differs between databases, in one place: column types, the database's clock, upserts, cursors.

Times are INTEGER microseconds since 1970 in the database and aware UTC datetimes outside it. They
come from the database's clock, because a lease that one machine grants is judged by another.
"""

from __future__ import annotations

import base64
import binascii
import json
from datetime import UTC, datetime, timedelta
from typing import Any
from uuid import UUID

import uuid_utils
from sqlalchemy import REAL, BigInteger, Connection, Double, Integer, Table, Text
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.engine import Dialect
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql import ColumnElement, select, type_coerce
from sqlalchemy.sql.compiler import SQLCompiler
from sqlalchemy.sql.functions import FunctionElement
from sqlalchemy.types import TypeDecorator, TypeEngine

from store.errors import InvalidCursor

__all__ = [
    "BIG", "DOUBLE", "Json", "Moment", "canonical_json", "cursor_after", "cursor_beyond", "id_of_cursor", "insert",
    "new_id", "now", "read_clock", "values_of_cursor",
]  # fmt: skip

# STRICT tables of SQLite know INTEGER and REAL only; both are 64 bits wide there.
BIG: TypeEngine[int] = BigInteger().with_variant(Integer(), "sqlite")
DOUBLE: TypeEngine[float] = Double().with_variant(REAL(), "sqlite")

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MICROSECOND = timedelta(microseconds=1)


class Moment(TypeDecorator[datetime]):
    """An aware datetime, kept as microseconds since 1970."""

    impl = BigInteger
    cache_ok = True

    def load_dialect_impl(self, dialect: Dialect) -> Any:
        return dialect.type_descriptor(Integer() if dialect.name == "sqlite" else BigInteger())

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> int | None:
        return None if value is None else (value - _EPOCH) // _MICROSECOND

    def process_result_value(self, value: int | None, dialect: Dialect) -> datetime | None:
        return None if value is None else _EPOCH + value * _MICROSECOND


class Json(TypeDecorator[Any]):
    """JSON in a TEXT column; None is SQL's NULL. NaN and infinity are refused, as JSON has neither."""

    impl = Text
    cache_ok = True

    def process_bind_param(self, value: Any, dialect: Dialect) -> str | None:
        return None if value is None else canonical_json(value)

    def process_result_value(self, value: str | None, dialect: Dialect) -> Any:
        return None if value is None else json.loads(value)


def canonical_json(value: Any) -> str:
    """The one text of a JSON value: keys in order, no blanks."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False, sort_keys=True, separators=(",", ":"))


class _Microseconds(FunctionElement[int]):
    """The database's clock."""

    type = BigInteger()
    inherit_cache = True


@compiles(_Microseconds, "sqlite")
def _sqlite_clock(_element: _Microseconds, _compiler: SQLCompiler, **_: Any) -> str:
    # A Julian day as a double resolves 40 microseconds and SQLite's clock 1 ms, so rounding to
    # milliseconds gives back the clock exactly. (unixepoch('subsec') needs SQLite 3.42.)
    return "(CAST(ROUND((julianday('now') - 2440587.5) * 86400000.0) AS INTEGER) * 1000)"


@compiles(_Microseconds, "postgresql")
def _postgresql_clock(_element: _Microseconds, _compiler: SQLCompiler, **_: Any) -> str:
    # Not now(), which stands still for the length of a transaction.
    return "CAST(EXTRACT(EPOCH FROM clock_timestamp()) * 1000000 AS BIGINT)"


def now(plus_seconds: float = 0.0) -> ColumnElement[datetime]:
    """The database's clock as an SQL expression, moved by some seconds."""
    clock: ColumnElement[int] = _Microseconds()
    if plus_seconds:
        clock = clock + round(plus_seconds * 1_000_000)
    return type_coerce(clock, Moment())


def read_clock(conn: Connection) -> datetime:
    """What the database's clock shows."""
    return conn.execute(select(now())).scalar_one()


def insert(conn: Connection, table: Table) -> sqlite.Insert | postgresql.Insert:
    """An INSERT with ``on_conflict_do_nothing`` and ``on_conflict_do_update`` for this database."""
    return postgresql.insert(table) if conn.dialect.name == "postgresql" else sqlite.insert(table)


def new_id() -> str:
    """A UUIDv7: ids sort by the time of their making."""
    return str(uuid_utils.uuid7())


def cursor_after(last_id: str) -> str:
    """The opaque cursor of the page that follows this id."""
    return base64.urlsafe_b64encode(UUID(last_id).bytes).rstrip(b"=").decode()


def cursor_beyond(*values: str | int) -> str:
    """The opaque cursor of the page that follows a row with these values."""
    return base64.urlsafe_b64encode(canonical_json(values).encode()).rstrip(b"=").decode()


def values_of_cursor(cursor: str, *kinds: type) -> list[Any]:
    """What ``cursor_beyond`` was given, each of its kind. Raises InvalidCursor."""
    try:
        found = json.loads(base64.b64decode(cursor + "=" * (-len(cursor) % 4), altchars=b"-_", validate=True))
    except (ValueError, RecursionError) as error:
        raise InvalidCursor(parameter="cursor") from error
    if not isinstance(found, list) or [type(value) for value in found] != list(kinds):
        raise InvalidCursor("The cursor is of another list, or of the same in another order.", parameter="cursor")
    if not all(map(_fits, found)):
        raise InvalidCursor(parameter="cursor")
    return found


def _fits(value: str | int) -> bool:
    """Whether every database takes it as a value: 64 bits, or text without lone surrogates and NUL."""
    if isinstance(value, int):
        return -(2**63) <= value < 2**63
    return "\0" not in value and not any("\ud800" <= letter <= "\udfff" for letter in value)


def id_of_cursor(cursor: str) -> str:
    """The id that ``cursor_after`` was given. Raises InvalidCursor."""
    try:
        return str(UUID(bytes=base64.b64decode(cursor + "==", altchars=b"-_", validate=True)))
    except (ValueError, binascii.Error) as error:
        raise InvalidCursor(parameter="cursor") from error
