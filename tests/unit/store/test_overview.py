"""Probes that anyone may send do not walk through all tasks each time."""

from __future__ import annotations

import pytest

from store import overview, tasks
from store.engine import Database


def test_an_overview_is_read_again_only_after_some_seconds(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = [100.0]
    monkeypatch.setattr(overview.time, "monotonic", lambda: clock[0])
    recent = overview.RecentOverview(seconds=5.0)
    with database.write() as conn:
        assert recent.read(conn) == overview.Overview({}, None)
        tasks.enqueue(conn, "query", blob="0" * 64)
        clock[0] += 4.9
        assert recent.read(conn).counts == {}
        clock[0] += 0.2
        assert recent.read(conn).counts == {("query", "queued"): 1}
