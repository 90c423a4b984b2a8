"""Calls about a shape, and what was learnt of it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, cast
from urllib.parse import quote

import httpx
import numpy as np
import numpy.typing as npt

from reebase.client import received
from reebase.client.records import Shape, Task, Upload
from reebase.client.requests import Source, collection_path, given, opened, shape_path
from reebase.client.tasks import TaskCalls
from reebase.errors import ParameterError
from reebase.mesh.health import Health
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read
from reebase.skeleton.graph import Skeleton

__all__ = ["ShapeCalls"]


class ShapeCalls(TaskCalls):
    """Shapes. What was learnt of one raises ServiceError (``result_not_found``) until it is indexed."""

    def upload(
        self, collection: str, source: Source, *, name: str | None = None, label: str | None = None,
        tags: Sequence[str] = (), metadata: Mapping[str, Any] | None = None, format: str | None = None,
    ) -> Upload:  # fmt: skip
        """Store a mesh; it is described in the background: ``wait(upload.task)``.

        A path is streamed. The same bytes again are the same shape, as it is: ``upload.created`` is False.
        format: where content and file name do not tell.
        Raises OSError for a file that cannot be read, RequestBroken for one that changes meanwhile, ServiceError:
        ``too_many_bytes``, ``unknown_format``, ``empty_file``, ``quota_exceeded``, ...
        """
        for tag in tags:
            if "," in tag:
                raise ParameterError(f"A tag must not hold a comma; found {tag!r}.", parameter="tags")
        form = {
            "name": name, "label": label, "tags": list(tags) or None, "format": format,
            "metadata": None if metadata is None else json.dumps(dict(metadata)),
        }  # fmt: skip
        with opened(source, name) as (filename, content):
            reply = self._http.request(
                "POST", collection_path(collection) + "/shapes", creates=True, data=given(form),
                files={"file": (filename, content)},
            )  # fmt: skip
        created = reply.status_code == httpx.codes.ACCEPTED
        values = self._http.object_of(reply)
        return cast(Upload, self._http.built(lambda found: received.upload_of(found, created), values))

    def shapes(
        self, collection: str, *, label: str | None = None, tags: Sequence[str] = (), state: str | None = None,
        sha256: str | None = None, text: str | None = None, sort: str | None = None,
    ) -> Iterator[Shape]:  # fmt: skip
        """The shapes of a collection, oldest first; those that have all that is given.

        text: in the name, the file's name or the label. sort: ``name``, ``label``, ``endpoints``, ``bytes`` or
        ``created``, with ``-`` before it the other way round.
        """
        filters = given({
            "label": label, "tag": list(tags) or None, "state": state, "sha256": sha256, "text": text, "sort": sort,
        })  # fmt: skip
        return self._pages(received.shape_of, collection_path(collection) + "/shapes", filters)

    def shape(self, collection: str, shape: str) -> Shape:
        """A shape by its id. Raises ServiceError: ``shape_not_found``."""
        return self._get(received.shape_of, shape_path(collection, shape))

    def update_shape(self, collection: str, shape: str, **changes: Any) -> Shape:
        """Change name, label (None takes it away), tags or metadata; tags and metadata are replaced whole."""
        return self._get(received.shape_of, shape_path(collection, shape), method="PATCH", json=changes)

    def delete_shape(self, collection: str, shape: str) -> None:
        """Delete a shape and all that was learnt of it. Raises ServiceError: ``shape_not_found``."""
        self._http.request("DELETE", shape_path(collection, shape))

    def restore_shape(self, collection: str, shape: str) -> Shape:
        """Undo its deletion, within a day. Raises ServiceError: ``shape_not_found``, ``shape_exists``."""
        return self._get(received.shape_of, shape_path(collection, shape) + "/restore", method="POST")

    def retry_shape(self, collection: str, shape: str) -> Task:
        """Describe a shape again that failed or was cancelled. Raises ServiceError: ``task_not_retryable``."""
        task = self.shape(collection, shape).task
        if task is None:
            raise ParameterError(f"Shape {shape} has no task to retry.", parameter="shape")
        return self.retry(task)

    def skeleton(self, collection: str, shape: str, *, of: str = "srg") -> Skeleton:
        """The pruned skeleton of a shape; of="extended": the one whose endpoints ``extended`` matches, in its order.

        One-ring areas are not sent: ``ring_areas`` is NaN.
        """
        return self._get(received.skeleton_of, f"{shape_path(collection, shape)}/skeleton?of={quote(of, safe='')}")

    def part_skeletons(self, collection: str, shape: str) -> list[Skeleton]:
        """The skeleton of each part of a shape as if it were alone, the largest first, 100 at most."""
        path = shape_path(collection, shape) + "/skeletons"
        return self._get(lambda found: [received.skeleton_of(one) for one in found["items"]], path)

    def field(self, collection: str, shape: str) -> npt.NDArray[np.float64]:
        """phi_2 at each vertex of the denoised mesh, (m,); NaN off the parts that the skeleton is of."""
        return self._get(received.field_of, shape_path(collection, shape) + "/field")

    def scalar(self, collection: str, shape: str, name: str) -> npt.NDArray[np.float32]:
        """A scalar at each vertex of the denoised mesh, (m,), NaN where unknown: ``phi2``, ``displacement``, ..."""
        path = f"{shape_path(collection, shape)}/fields/{quote(name, safe='')}"
        return np.frombuffer(self._http.request("GET", path).content, dtype="<f4")

    def thumbnail(self, collection: str, shape: str) -> bytes:
        """A small picture, PNG with a transparent ground."""
        return self._http.request("GET", shape_path(collection, shape) + "/thumbnail").content

    def display_mesh(self, collection: str, shape: str) -> bytes:
        """A GLB of at most 100,000 faces with scalar fields, and the surface before denoising as a morph target."""
        return self._http.request("GET", shape_path(collection, shape) + "/display").content

    def features(self, collection: str, shape: str) -> npt.NDArray[np.float64]:
        """omega of each endpoint, (k, 3): relative area, relative path lengths, relative distance to the root."""
        return self._get(received.features_of, shape_path(collection, shape) + "/features")

    def health(self, collection: str, shape: str) -> Health:
        """What was found in the mesh, what was repaired, what is unusual."""
        return self._get(lambda found: Health.from_json(found["report"]), shape_path(collection, shape) + "/health")

    def mesh(self, collection: str, shape: str, *, stage: str = "denoised") -> Mesh:
        """The ``cleaned`` or the ``denoised`` mesh."""
        return read(self.mesh_bytes(collection, shape, stage=stage, format="ply"), "ply")

    def mesh_bytes(self, collection: str, shape: str, *, stage: str = "denoised", format: str = "glb") -> bytes:
        """The ``cleaned`` or ``denoised`` mesh as a file: ply, glb, obj, stl or off."""
        parameters = {"stage": stage, "format": format}
        return self._http.request("GET", shape_path(collection, shape) + "/mesh", params=parameters).content

    def original(self, collection: str, shape: str) -> bytes:
        """The bytes that were uploaded; they are there before the shape is indexed."""
        return self._http.request("GET", shape_path(collection, shape) + "/original").content
