"""What differs between databases: types, clock, upserts; and that it is written for PostgreSQL too."""

from __future__ import annotations

import base64
from datetime import UTC, datetime, timedelta, timezone

import pytest
from sqlalchemy import select
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.schema import CreateIndex, CreateTable

from store import tables
from store.errors import InvalidCursor
from store.sql import (
    Json,
    Moment,
    canonical_json,
    cursor_after,
    cursor_beyond,
    id_of_cursor,
    new_id,
    now,
    values_of_cursor,
)

DIALECT = sqlite.dialect()


@pytest.mark.parametrize(
    "moment",
    [
        datetime(1970, 1, 1, tzinfo=UTC),
        datetime(2026, 11, 22, 8, 6, 22, 766001, tzinfo=UTC),
        datetime(1969, 12, 31, 23, 59, 59, 999999, tzinfo=UTC),
        datetime(2026, 1, 1, 1, tzinfo=timezone(timedelta(hours=5, minutes=30))),
    ],
)
def test_moments_keep_every_microsecond(moment: datetime) -> None:
    stored = Moment().process_bind_param(moment, DIALECT)
    assert isinstance(stored, int)
    back = Moment().process_result_value(stored, DIALECT)
    assert back == moment
    assert back is not None and back.utcoffset() == timedelta(0)


def test_json_has_one_text_and_no_nan() -> None:
    value = {"b": [1, 2.5, None, True], "a": "ü"}
    assert canonical_json(value) == '{"a":"ü","b":[1,2.5,null,true]}'
    stored = Json().process_bind_param(value, DIALECT)
    assert Json().process_result_value(stored, DIALECT) == value
    assert Json().process_bind_param(None, DIALECT) is None
    for wrong in (float("nan"), float("inf")):
        with pytest.raises(ValueError, match="JSON compliant"):
            canonical_json(wrong)


def test_ids_sort_by_time_and_cursors_give_them_back() -> None:
    made = [new_id() for _ in range(1000)]
    assert made == sorted(set(made))
    assert id_of_cursor(cursor_after(made[0])) == made[0]
    for wrong in ("", "=", cursor_after(made[0])[:-2], cursor_after(made[0]) + "AAAA", made[0], "\u0000"):
        with pytest.raises(InvalidCursor):
            id_of_cursor(wrong)


def test_cursors_give_values_back_and_only_such_as_a_database_takes() -> None:
    for fine in (("name", "Ü\U0001f41c", "x"), ("bytes", 2**63 - 1, "x"), ("bytes", -(2**63), "x")):
        assert values_of_cursor(cursor_beyond(*fine), str, type(fine[1]), str) == list(fine)
    crafted = ['["name","\\ud800","x"]', '["name","\\u0000","x"]', '["name","a","\\udfff"]', f'["bytes",{10**30},"x"]',
               f'["bytes",{2**63},"x"]', f'["bytes",{-(2**63) - 1},"x"]', '["bytes",NaN,"x"]', '["bytes",true,"x"]',
               "[" * 100_000, "{}"]  # fmt: skip
    for text in crafted:
        cursor = base64.urlsafe_b64encode(text.encode()).rstrip(b"=").decode()
        for kind in (str, int):
            with pytest.raises(InvalidCursor):
                values_of_cursor(cursor, str, kind, str)


def test_the_tables_are_postgresql_too() -> None:
    dialect = postgresql.dialect()
    for table in tables.metadata.sorted_tables:
        statement = str(CreateTable(table).compile(dialect=dialect))
        assert "STRICT" not in statement
        assert " REAL" not in statement  # half as wide there
        for index in table.indexes:
            where = index.dialect_options["postgresql"]["where"]
            assert (where is None) == (index.dialect_options["sqlite"]["where"] is None)
            assert (where is None) or f"WHERE {where}" in str(CreateIndex(index).compile(dialect=dialect))
    clock = str(select(now(5)).compile(dialect=dialect, compile_kwargs={"literal_binds": True}))
    assert "clock_timestamp()" in clock and "5000000" in clock
