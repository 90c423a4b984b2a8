"""What queries search, in memory and kept up with the database by its revision.

``IndexFollower(database, memory_bytes)``
  ``.index(collection_id, profile_key) -> reebase.search.Index``: endpoint features, for D
  ``.gallery(collection_id, profile_key, ranking) -> Hung``: what any ranking compares, and who lacks it
  ``.read_ahead(ranking, stopping)``: the galleries of all collections that fit

Each call looks at the revision and applies what changed since the last one: rows written later, and
tombstones of shapes deleted later. So a process sees what other processes commit, at the cost of one
small read when nothing changed.
"""

from __future__ import annotations

import itertools
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from sqlalchemy import Connection, exists, func, select

from reebase.ranking import Ranking
from reebase.search import Gallery, Index
from store import collections, descriptors, revision
from store.descriptors import Described
from store.engine import Database
from store.errors import CollectionNotFound
from store.tables import collection, endpoint_features, tombstone

__all__ = ["Hung", "IndexFollower"]

_BATCH = 1000
"""Shapes that are hung in a gallery at once, and as many as it has where that is more: what is read for them is held
twice meanwhile, and what hangs already is copied each time."""

_MEMORY = 1 << 30

_SHAPE = 40_000
"""Bytes that a shape may take in a gallery, when it must be guessed: twice what `fused` keeps of one."""

Held = TypeVar("Held", "Hung", Index)
Advance = Callable[[Held, Iterator[Described], list[str]], Held]
Key = tuple[str, Ranking | None]


@dataclass(frozen=True)
class Hung:
    """A gallery, and the shapes that are described but lack something that it compares."""

    gallery: Gallery
    lacking: frozenset[str] = frozenset()


@dataclass
class _Followed:
    """What is held of one collection: under which profile, and up to which revision it is complete."""

    profile_key: str
    held: Any
    seen: int = -1


class IndexFollower:
    """What one process holds; any thread may ask.

    memory_bytes: of all galleries together. Beyond it those that were asked for longest ago are dropped, to be read
    anew when they are asked for; the one in use stays, however large.
    """

    def __init__(self, database: Database, memory_bytes: int = _MEMORY) -> None:
        self._database = database
        self._memory_bytes = memory_bytes
        self._lock = threading.Lock()
        self._locks: dict[Key, threading.Lock] = {}
        self._followed: OrderedDict[Key, _Followed] = OrderedDict()

    def index(self, collection_id: str, profile_key: str) -> Index:
        """The index of a collection under a profile, with everything that is committed by now.

        Raises CollectionNotFound when the collection was deleted.
        """
        return self._current((collection_id, None), profile_key, Index, _indexed)

    def gallery(self, collection_id: str, profile_key: str, ranking: Ranking) -> Hung:
        """The gallery of a collection for a ranking, re-ranked or not, as complete as ``index``. Raises as that."""
        ranking = replace(ranking, rerank=False)
        key = (collection_id, ranking)
        hung = self._current(key, profile_key, lambda: Hung(Gallery(ranking)), _hung)
        self._make_room(key)
        return hung

    def read_ahead(self, ranking: Ranking, stopping: threading.Event) -> None:
        """Read the galleries of all collections, largest first, while there is memory: before anybody waits for them.

        stopping: set when it is to end. What is read before a query is what a query would read.
        """
        shapes = func.count().label("shapes")
        by_size = (
            select(endpoint_features.c.collection_id, shapes)
            .group_by(endpoint_features.c.collection_id).order_by(shapes.desc())
        )  # fmt: skip
        with self._database.read() as conn:
            counted = conn.execute(by_size).all()
        room = self._memory_bytes
        for row in counted:
            room -= row.shapes * _SHAPE
            if room < 0 or stopping.is_set():
                return
            with suppress(CollectionNotFound):
                with self._database.read() as conn:
                    key = collections.by_id(conn, row.collection_id).profile_key
                self.gallery(row.collection_id, key, ranking)

    def _current(self, key: Key, profile_key: str, new: Callable[[], Held], advance: Advance[Held]) -> Held:
        collection_id, ranking = key
        with self._lock:
            lock = self._locks.setdefault(key, threading.Lock())
        # One thread brings what is held up to date; readers of it never wait.
        with lock, self._database.read() as conn:
            followed = self._followed.get(key)
            at = revision.current(conn)
            if followed is not None and followed.profile_key == profile_key and followed.seen == at:
                held: Held = followed.held
                return held
            if not conn.execute(select(exists().where(collection.c.id == collection_id))).scalar_one():
                self._forget(collection_id)
                raise CollectionNotFound("The collection was deleted.")
            usable = followed is not None and followed.profile_key == profile_key
            if followed is None or not usable or followed.seen < revision.floor(conn):
                followed = _Followed(profile_key, new())
            names = (descriptors.SRG,) if ranking is None else tuple(ranking.parts)
            changed = descriptors.described(
                conn, names, profile_key,
                endpoint_features.c.collection_id == collection_id, endpoint_features.c.revision > followed.seen,
            )  # fmt: skip
            followed.held = advance(followed.held, changed, _deleted(conn, collection_id, followed.seen))
            followed.seen = at
            with self._lock:
                self._followed[key] = followed
            return followed.held  # type: ignore[no-any-return]

    def _make_room(self, used: Key) -> None:
        with self._lock:
            if used in self._followed:
                self._followed.move_to_end(used)
            sizes = {key: one.held.gallery.bytes for key, one in self._followed.items() if isinstance(one.held, Hung)}
            held = sum(sizes.values())
            for key, size in sizes.items():
                if held > self._memory_bytes and key != used:
                    del self._followed[key]
                    held -= size

    def _forget(self, collection_id: str) -> None:
        with self._lock:
            for key in [key for key in self._locks if key[0] == collection_id]:
                self._followed.pop(key, None)
                self._locks.pop(key, None)


def _deleted(conn: Connection, collection_id: str, since: int) -> list[str]:
    gone = select(tombstone.c.shape_id).where(
        tombstone.c.collection_id == collection_id, tombstone.c.revision > since
    )
    return list(conn.execute(gone).scalars())


def _indexed(index: Index, changed: Iterable[Described], deleted: list[str]) -> Index:
    for one in changed:
        if one.current:
            index.add(one.shape_id, one.kept[descriptors.SRG])
        else:
            index.remove(one.shape_id)
    for shape_id in deleted:
        index.remove(shape_id)
    return index


def _hung(hung: Hung, changed: Iterator[Described], deleted: list[str]) -> Hung:
    gallery, lacking = hung.gallery, set(hung.lacking)
    parts = len(gallery.ranking.parts)
    while batch := list(itertools.islice(changed, max(_BATCH, len(gallery)))):
        gallery = gallery.changed(
            {one.shape_id: one.kept for one in batch if len(one.kept) == parts},
            [one.shape_id for one in batch if len(one.kept) < parts],
        )
        lacking -= {one.shape_id for one in batch}
        lacking |= {one.shape_id for one in batch if one.current and len(one.kept) < parts}
    if deleted:
        gallery = gallery.changed({}, deleted)
    return Hung(gallery, frozenset(lacking.difference(deleted)))
