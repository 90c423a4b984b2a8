"""The index in memory, kept up with the database by its revision.

``IndexFollower(database)``: ``.index(collection_id, profile_key) -> reebase.search.Index``

Each call looks at the revision and applies what changed since the last one: rows written later, and
tombstones of shapes deleted later. So a process sees what other processes commit, at the cost of one
small read when nothing changed.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, field

from sqlalchemy import Connection, exists, select

from reebase.search import Index
from store import revision
from store.engine import Database
from store.errors import CollectionNotFound
from store.results import features_of_bytes
from store.tables import collection, endpoint_features, present, shape, tombstone

__all__ = ["IndexFollower"]


@dataclass
class _Followed:
    """The index of one collection: of which profile, and up to which revision it is complete."""

    profile_key: str
    index: Index = field(default_factory=Index)
    seen: int = -1


class IndexFollower:
    """The indexes of one process; any thread may ask."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._lock = threading.Lock()
        self._locks: dict[str, threading.Lock] = {}
        self._followed: dict[str, _Followed] = {}

    def index(self, collection_id: str, profile_key: str) -> Index:
        """The index of a collection under a profile, with everything that is committed by now.

        Raises CollectionNotFound when the collection was deleted.
        """
        with self._lock:
            lock = self._locks.setdefault(collection_id, threading.Lock())
        # One thread brings a collection up to date; readers of the index itself never wait.
        with lock, self._database.read() as conn:
            followed = self._followed.get(collection_id)
            at = revision.current(conn)
            if followed is not None and followed.profile_key == profile_key and followed.seen == at:
                return followed.index
            if not conn.execute(select(exists().where(collection.c.id == collection_id))).scalar_one():
                self._forget(collection_id)
                raise CollectionNotFound("The collection was deleted.")
            usable = followed is not None and followed.profile_key == profile_key
            if followed is None or not usable or followed.seen < revision.floor(conn):
                followed = _Followed(profile_key)
            self._catch_up(conn, collection_id, followed)
            followed.seen = at
            self._followed[collection_id] = followed
            return followed.index

    def _catch_up(self, conn: Connection, collection_id: str, followed: _Followed) -> None:
        rows = endpoint_features
        changed = (
            select(rows.c.shape_id, rows.c.profile_key, rows.c.features)
            .join(shape, shape.c.id == rows.c.shape_id)
            .where(rows.c.collection_id == collection_id, rows.c.revision > followed.seen, present)
            .order_by(rows.c.shape_id)
        )
        for shape_id, profile_key, features in conn.execute(changed):
            if profile_key == followed.profile_key:
                followed.index.add(shape_id, features_of_bytes(features))
            else:
                followed.index.remove(shape_id)
        deleted = select(tombstone.c.shape_id).where(
            tombstone.c.collection_id == collection_id, tombstone.c.revision > followed.seen
        )
        for shape_id in conn.execute(deleted).scalars():
            followed.index.remove(shape_id)

    def _forget(self, collection_id: str) -> None:
        self._followed.pop(collection_id, None)
        with self._lock:
            self._locks.pop(collection_id, None)
