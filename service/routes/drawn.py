"""What a page draws of a shape, or of the mesh of a query: a thumbnail, a light mesh, scalars on vertices."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

import numpy as np
from fastapi import Path, Query
from sqlalchemy import Connection
from starlette.requests import Request
from starlette.responses import Response

from reebase.errors import unknown_name
from service.auth import Principal, Reader
from service.conditional import unless_unchanged
from service.context import Context, Here
from service.routes.common import CollectionPath, IdPath, SkeletonOf, api_router, open_collection
from service.routes.tasks import own_task
from service.schemas.drawn import FieldInfo, FieldsValue
from service.schemas.shapes import SkeletonValue
from store import outputs, results, shapes
from store.errors import ResultNotFound
from store.records import StoredSkeleton

__all__ = ["router"]

router = api_router("results")

_SHAPE = "/collections/{collection}/shapes/{shape}"
_JSON = "application/json"
_TYPES = {"thumbnail": "image/png", "display": "model/gltf-binary", "skeleton": _JSON, "limbs": _JSON}


def _responses(media_type: str, description: str) -> dict[int | str, dict[str, Any]]:
    binary = {"schema": {"type": "string", "format": "binary"}}
    return {
        200: {"description": description, "content": {media_type: binary}}, 304: {"description": "Not modified."}
    }  # fmt: skip


_THUMBNAIL = _responses("image/png", "The picture.")
_DISPLAY = _responses("model/gltf-binary", "The mesh.")
_FIELD = _responses("application/octet-stream", "The numbers.")


def _stored(conn: Connection, principal: Principal, collection: str, shape: str) -> StoredSkeleton:
    found = shapes.get(conn, open_collection(conn, principal, collection).id, shape)
    return results.skeleton(conn, found.id)


def _blob(request: Request, here: Context, sha256: str | None, what: str, *, forever: bool = False) -> Response:
    """forever: the address names these bytes."""
    if sha256 is None:
        raise ResultNotFound(f"The shape was described before there was a {what}; describe it anew.")
    caching = {"Cache-Control": "private, max-age=31536000, immutable"} if forever else {}

    def make() -> Response:
        return Response(here.blobs.get(sha256), media_type=_TYPES[what], headers=caching)

    return unless_unchanged(request, sha256, make)


@router.get(
    f"{_SHAPE}/thumbnail", operation_id="getThumbnail", summary="Thumbnail", response_class=Response,
    responses=_THUMBNAIL,
)  # fmt: skip
def get_thumbnail(
    request: Request, here: Here, principal: Reader, collection: CollectionPath, shape: IdPath,
    of: Annotated[
        str | None, Query(description="As in the shape's `thumbnail`: the answer may then be kept for ever.")
    ] = None,
) -> Response:  # fmt: skip
    """A picture of 192 by 192 pixels and at most 10 kB, on a transparent ground."""
    with here.database.read() as conn:
        sha256 = _stored(conn, principal, collection, shape).thumbnail_sha256
    return _blob(request, here, sha256, "thumbnail", forever=sha256 is not None and of == sha256)


@router.get(
    f"{_SHAPE}/display", operation_id="getDisplayMesh", summary="Mesh to draw", response_class=Response,
    responses=_DISPLAY,
)  # fmt: skip
def get_display(
    request: Request, here: Here, principal: Reader, collection: CollectionPath, shape: IdPath
) -> Response:
    """A GLB of at most 100,000 faces with the scalar fields on its vertices.

    POSITION is the denoised surface, as the node's translation places it; the morph target `cleaned` leads back to
    the surface before denoising. A field is an attribute such as `_PHI2`, and `_PHI2_MISSING` is 1 where it is
    unknown. `asset.extras` tells what the fields mean, their range, and whether the mesh was made lighter.
    """
    with here.database.read() as conn:
        stored = _stored(conn, principal, collection, shape)
    return _blob(request, here, stored.display_sha256, "display")


@router.get(f"{_SHAPE}/fields", operation_id="listFields", summary="Scalar fields")
def list_fields(here: Here, principal: Reader, collection: CollectionPath, shape: IdPath) -> FieldsValue:
    """The scalars that there are on the vertices of the shape's meshes."""
    from reebase.pictures.display import named_fields

    with here.database.read() as conn:
        _stored(conn, principal, collection, shape)
        field = open_collection(conn, principal, collection).profile["field"]
    return FieldsValue(items=[FieldInfo(**asdict(one)) for one in named_fields(field)])


@router.get(
    f"{_SHAPE}/fields/{{field}}", operation_id="getFieldValues", summary="A scalar field as numbers",
    response_class=Response, responses=_FIELD,
)  # fmt: skip
def get_field(
    request: Request, here: Here, principal: Reader, collection: CollectionPath, shape: IdPath,
    field: Annotated[str, Path(description="One of the shape's fields.", examples=["displacement"])],
) -> Response:  # fmt: skip
    """float32, little endian, one for each vertex of the denoised mesh in its order; NaN where it is unknown."""
    from reebase.mesh.read import read, read_scalars
    from reebase.pictures.display import FIELDS, fields_of

    with here.database.read() as conn:
        stored = _stored(conn, principal, collection, shape)
    names = [known.name for known in FIELDS]
    if field not in names:
        raise unknown_name("field", field, names)

    def make() -> Response:
        denoised, scalars = read_scalars(here.blobs.get(stored.denoised_sha256))
        cleaned = read(here.blobs.get(stored.cleaned_sha256))
        values = fields_of(cleaned, denoised, scalars["phi2"])[field]
        most = float(np.finfo(np.float32).max)
        data = np.clip(values, -most, most).astype("<f4").tobytes()
        return Response(data, media_type="application/octet-stream")

    return unless_unchanged(request, f"{stored.denoised_sha256}-{stored.cleaned_sha256[:16]}-{field}", make)


def _of_task(request: Request, here: Context, principal: Principal, task: str, what: str) -> Response:
    with here.database.read() as conn:
        sha256 = outputs.find(conn, own_task(conn, here, principal, task), what)
    return _blob(request, here, sha256, what)


@router.get(
    "/tasks/{task}/thumbnail", operation_id="getTaskThumbnail", summary="Thumbnail of a query's mesh",
    response_class=Response, responses=_THUMBNAIL,
)  # fmt: skip
def get_task_thumbnail(request: Request, here: Here, principal: Reader, task: IdPath) -> Response:
    """As that of a shape, for the mesh that a query brought; kept as long as the task.

    Only for the API key that asked, and for those with the scope admin.
    """
    return _of_task(request, here, principal, task, "thumbnail")


@router.get(
    "/tasks/{task}/display", operation_id="getTaskDisplayMesh", summary="Mesh of a query to draw",
    response_class=Response, responses=_DISPLAY,
)  # fmt: skip
def get_task_display(request: Request, here: Here, principal: Reader, task: IdPath) -> Response:
    """As that of a shape, for the mesh that a query brought; kept as long as the task.

    Only for the API key that asked, and for those with the scope admin.
    """
    return _of_task(request, here, principal, task, "display")


@router.get(
    "/tasks/{task}/skeleton", operation_id="getTaskSkeleton", summary="Skeleton of a query's mesh",
    response_model=SkeletonValue,
)  # fmt: skip
def get_task_skeleton(
    request: Request, here: Here, principal: Reader, task: IdPath, of: SkeletonOf = "srg"
) -> Response:
    """As that of a shape, for the mesh that a query brought; kept as long as the task.

    Only for the API key that asked, and for those with the scope admin.
    """
    return _of_task(request, here, principal, task, "skeleton" if of == "srg" else "limbs")
