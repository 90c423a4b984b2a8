"""Calls about collections, and about many shapes of one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from reebase.client import received
from reebase.client.errors import ServiceError
from reebase.client.records import Collection, Coverage, Duplicates, Task
from reebase.client.requests import Requests, collection_path, given

__all__ = ["CollectionCalls"]


class CollectionCalls(Requests):
    """Collections, and what concerns many of their shapes."""

    def collections(self) -> Iterator[Collection]:
        """All collections, oldest first."""
        return self._pages(received.collection_of, "/v1/collections", {})

    def create_collection(
        self, name: str, *, description: str = "", profile: Mapping[str, Any] | None = None, exist_ok: bool = False
    ) -> Collection:
        """Make a collection; with ``exist_ok`` one that is there is returned as it is.

        profile: parameters of the pipeline that shall differ from the defaults, as ``{"bands": 64}``.
        Raises ServiceError: ``collection_exists``, ``validation_error``, ``unknown_name``.
        """
        if exist_ok:
            # First a look, because a key of this collection alone may not make any.
            try:
                return self.collection(name)
            except ServiceError as refusal:
                if refusal.code != "collection_not_found":
                    raise
        body = {"name": name, "description": description, "profile": dict(profile or {})}
        try:
            return self._get(received.collection_of, "/v1/collections", method="POST", creates=True, json=body)
        except ServiceError as refusal:
            if exist_ok and refusal.code == "collection_exists":
                return self.collection(name)
            raise

    def collection(self, name: str) -> Collection:
        """A collection with its counts. Raises ServiceError: ``collection_not_found``."""
        return self._get(received.collection_of, collection_path(name))

    def update_collection(
        self, name: str, *, description: str | None = None, profile: Mapping[str, Any] | None = None
    ) -> Collection:
        """Change a collection; another profile queues all its shapes to be described again."""
        body = {"description": description, "profile": None if profile is None else dict(profile)}
        changes = {key: value for key, value in body.items() if value is not None}
        return self._get(received.collection_of, collection_path(name), method="PATCH", json=changes)

    def delete_collection(self, name: str) -> None:
        """Delete a collection with all its shapes. Raises ServiceError: ``collection_not_found``."""
        self._http.request("DELETE", collection_path(name))

    def delete_shapes(self, collection: str, shapes: Sequence[str]) -> tuple[str, ...]:
        """Delete up to 1000 shapes; the ids of those that were there."""
        body = {"shapes": list(shapes)}
        path = collection_path(collection) + "/bulk/delete"
        return self._get(lambda found: tuple(found["deleted"]), path, method="POST", json=body)

    def restore_shapes(self, collection: str, shapes: Sequence[str]) -> tuple[str, ...]:
        """Undo deletions of up to 1000 shapes; the ids of those that are there again."""
        body = {"shapes": list(shapes)}
        path = collection_path(collection) + "/bulk/restore"
        return self._get(lambda found: tuple(found["restored"]), path, method="POST", json=body)

    def label_shapes(self, collection: str, shapes: Sequence[str], label: str | None) -> int:
        """Give up to 1000 shapes a label, or with None take theirs away; how many were there."""
        body = {"shapes": list(shapes), "label": label}
        path = collection_path(collection) + "/bulk/label"
        return self._get(lambda found: int(found["labelled"]), path, method="POST", json=body)

    def labels(self, collection: str) -> dict[str | None, int]:
        """Each label with the number of its shapes, most first; None for shapes without one."""
        path = collection_path(collection) + "/labels"
        return self._get(lambda found: {row["label"]: row["shapes"] for row in found["items"]}, path)

    def add_synthetic(self, collection: str, *, per_class: int = 25, seed: int = 0) -> Task:
        """Fill the collection with the labelled synthetic set; a task makes one shape after another."""
        body = {"per_class": per_class, "seed": seed}
        return self._get(received.task_of, collection_path(collection) + "/synthetic", method="POST", json=body)

    def make_map(self, collection: str, *, descriptor: str | None = None) -> Task:
        """Have the map of the collection made, unless it is current."""
        body = {"descriptor": descriptor}
        return self._get(received.task_of, collection_path(collection) + "/map", method="POST", json=body)

    def map(self, collection: str, *, descriptor: str | None = None) -> dict[str, tuple[float, float]]:
        """Where shapes lie on the latest map, by id, both coordinates in [-1, 1]; empty before there is one."""
        path = collection_path(collection) + "/map"
        asked = given({"descriptor": descriptor})
        return self._get(
            lambda found: {one["shape"]: (one["x"], one["y"]) for one in found["points"]}, path, params=asked
        )

    def coverage(self, collection: str) -> Coverage:
        """Of how many shapes each descriptor is kept."""

        def made(found: Mapping[str, Any]) -> Coverage:
            return Coverage(found["described"], {one["name"]: one["shapes"] for one in found["items"]})

        return self._get(made, collection_path(collection) + "/descriptors")

    def reindex(self, collection: str, descriptors: Sequence[str] = ()) -> int:
        """Queue the shapes that lack a descriptor which the service keeps, or one of these; how many that are."""
        path, body = collection_path(collection) + "/reindex", {"descriptors": list(descriptors)}
        return self._get(lambda found: int(found["queued"]), path, method="POST", reads=True, json=body)

    def find_duplicates(self, collection: str) -> Task:
        """Have near-duplicates sought; the task that does it, or did it when nothing changed since."""
        return self._get(received.task_of, collection_path(collection) + "/duplicates", method="POST", reads=True)

    def duplicates(self, collection: str, *, shape: str | None = None, confidence: str = "fair", limit: int = 1000
                   ) -> Duplicates:  # fmt: skip
        """What the latest search found, the strongest first; nothing is ever deleted because of it.

        shape: only findings with this one. confidence: ``certain``, ``strong`` or ``fair``, the least to be told.
        """
        asked = given({"shape": shape, "confidence": confidence, "limit": limit})
        return self._get(received.duplicates_of, collection_path(collection) + "/duplicates", params=asked)
