"""What the pipeline learnt of a shape, and the bytes it came as."""

from __future__ import annotations

import json
import math
from typing import Any, Literal

from starlette.requests import Request
from starlette.responses import Response

from service.auth import Principal, Reader
from service.conditional import unless_unchanged
from service.context import Context, Here
from service.downloads import file_response
from service.routes.about import WRITTEN
from service.routes.common import CollectionPath, IdPath, SkeletonOf, api_router, open_collection
from service.schemas.shapes import FeaturesValue, FieldValue, HealthValue, PartSkeletonsValue, SkeletonValue
from store import results, shapes
from store.errors import ResultNotFound
from store.records import Shape, StoredSkeleton

__all__ = ["router"]

router = api_router("results")

_SHAPE = "/collections/{collection}/shapes/{shape}"
_BINARY: dict[str, Any] = {"schema": {"type": "string", "format": "binary"}}
_MESH_RESPONSE: dict[int | str, dict[str, Any]] = {
    200: {"description": "The mesh.", "content": dict.fromkeys(WRITTEN.values(), _BINARY)},
    304: {"description": "Not modified."},
}
_ORIGINAL_RESPONSE: dict[int | str, dict[str, Any]] = {
    200: {"description": "The bytes.", "content": {"application/octet-stream": _BINARY}},
    304: {"description": "Not modified."},
}


def _json(value: dict[str, Any]) -> Response:
    """Large arrays go out as they are: checking each number again would cost more than computing it."""
    return Response(json.dumps(value, allow_nan=False).encode(), media_type="application/json")


def _skeleton(
    here: Context, principal: Principal, collection: str, shape: str
) -> tuple[Shape, StoredSkeleton]:
    with here.database.read() as conn:
        found = shapes.get(conn, open_collection(conn, principal, collection).id, shape)
        return found, results.skeleton(conn, found.id)


@router.get(
    f"{_SHAPE}/skeleton", operation_id="getSkeleton", summary="Skeleton", response_model=SkeletonValue
)
def get_skeleton(
    here: Here, principal: Reader, collection: CollectionPath, shape: IdPath, of: SkeletonOf = "srg"
) -> Response:
    """Nodes, edges, endpoints with their ω, and the root, of the pruned spectral Reeb graph.

    `of=extended`: of the Reeb graph of the auto diffusion field; its endpoints, without ω, are those that `extended`
    matches, in their order.
    """
    with here.database.read() as conn:
        found = shapes.get(conn, open_collection(conn, principal, collection).id, shape)
        stored = results.skeleton(conn, found.id)
        omega = results.features(conn, found.id).features if of == "srg" else None
    graph = stored.skeleton if of == "srg" else stored.limbs
    if graph is None:
        raise ResultNotFound(
            "No skeleton of `extended` is kept of the shape: it was described without that descriptor.", shape=found.id
        )
    return _json({
        "shape": found.id, "profile_key": stored.profile_key, "pipeline_version": stored.pipeline_version,
        **results.skeleton_value(graph, omega, stored.eigenvalues),
    })  # fmt: skip


@router.get(
    f"{_SHAPE}/skeletons", operation_id="getPartSkeletons", summary="Skeletons of the parts",
    response_model=PartSkeletonsValue,
)  # fmt: skip
def get_part_skeletons(here: Here, principal: Reader, collection: CollectionPath, shape: IdPath) -> Response:
    """Of a shape in several parts the skeleton of each by itself, the largest first; of one part just that.

    `/skeleton` is of all parts, joined where they are near, or of the largest, as the collection's profile says.
    """
    from reebase.matching.features import endpoint_features

    with here.database.read() as conn:
        opened = open_collection(conn, principal, collection)
        found = shapes.get(conn, opened.id, shape)
        stored = results.skeleton(conn, found.id)
        graphs = results.part_skeletons(conn, found.id)
    area = opened.profile["area"]
    return _json({
        "shape": found.id, "profile_key": stored.profile_key, "pipeline_version": stored.pipeline_version,
        "items": [results.graph_value(graph, endpoint_features(graph, area)) for graph in graphs],
    })  # fmt: skip


@router.get(f"{_SHAPE}/field", operation_id="getField", summary="Scalar field", response_model=FieldValue)
def get_field(
    request: Request, here: Here, principal: Reader, collection: CollectionPath, shape: IdPath
) -> Response:
    """φ₂, or the profile's other field, at each vertex of the denoised mesh, in the order of its vertices."""
    from reebase.mesh.read import read_scalars

    with here.database.read() as conn:
        opened = open_collection(conn, principal, collection)
        found = shapes.get(conn, opened.id, shape)
        stored = results.skeleton(conn, found.id)
    name = opened.profile["field"]

    def make() -> Response:
        _, scalars = read_scalars(here.blobs.get(stored.denoised_sha256))
        values = [value if math.isfinite(value) else None for value in scalars["phi2"].tolist()]
        return _json(
            {"shape": found.id, "profile_key": stored.profile_key, "field": name, "values": values}
        )

    return unless_unchanged(request, f"{stored.denoised_sha256}-{stored.profile_key}-{name}", make)


@router.get(f"{_SHAPE}/features", operation_id="getFeatures", summary="Feature vectors")
def get_features(here: Here, principal: Reader, collection: CollectionPath, shape: IdPath) -> FeaturesValue:
    """ω = (a, dv, dc) of each endpoint, in the order of the skeleton's endpoints."""
    with here.database.read() as conn:
        found = shapes.get(conn, open_collection(conn, principal, collection).id, shape)
        stored = results.features(conn, found.id)
    return FeaturesValue(
        shape=found.id, profile_key=stored.profile_key, pipeline_version=stored.pipeline_version,
        endpoint_count=stored.endpoint_count, features=stored.features.tolist(),
    )  # fmt: skip


@router.get(f"{_SHAPE}/health", operation_id="getHealth", summary="Health report")
def get_health(here: Here, principal: Reader, collection: CollectionPath, shape: IdPath) -> HealthValue:
    """What was found in the mesh, what was repaired, what is unusual, and how long each stage took."""
    with here.database.read() as conn:
        found = shapes.get(conn, open_collection(conn, principal, collection).id, shape)
        stored = results.health(conn, found.id)
    return HealthValue(
        shape=found.id, profile_key=stored.profile_key, pipeline_version=stored.pipeline_version,
        report=stored.report.to_json(), seconds=stored.seconds,
    )  # fmt: skip


@router.get(
    f"{_SHAPE}/mesh", operation_id="getMesh", summary="Cleaned or denoised mesh", response_class=Response,
    responses=_MESH_RESPONSE,
)  # fmt: skip
def get_mesh(
    request: Request, here: Here, principal: Reader, collection: CollectionPath, shape: IdPath,
    stage: Literal["cleaned", "denoised"] = "denoised",
    format: Literal["ply", "glb", "obj", "stl", "off"] = "ply",
) -> Response:  # fmt: skip
    """The mesh after cleaning, or after denoising; as PLY the latter carries the field as `phi2`."""
    from reebase.mesh.read import read_scalars
    from reebase.mesh.write import to_bytes

    found, stored = _skeleton(here, principal, collection, shape)
    sha256 = stored.cleaned_sha256 if stage == "cleaned" else stored.denoised_sha256

    def content() -> bytes:
        data = here.blobs.get(sha256)
        if format == "ply":
            return data
        mesh, scalars = read_scalars(data)
        return to_bytes(mesh, format, scalars=scalars if format == "glb" else None)

    return file_response(
        request, content, etag=f"{sha256}-{format}", media_type=WRITTEN[format],
        filename=f"{found.name}-{stage}.{format}",
    )  # fmt: skip


@router.get(
    f"{_SHAPE}/original", operation_id="getOriginal", summary="The uploaded bytes", response_class=Response,
    responses=_ORIGINAL_RESPONSE,
)  # fmt: skip
def get_original(
    request: Request, here: Here, principal: Reader, collection: CollectionPath, shape: IdPath
) -> Response:
    """Exactly what was uploaded."""
    with here.database.read() as conn:
        found = shapes.get(conn, open_collection(conn, principal, collection).id, shape)
    return file_response(
        request, lambda: here.blobs.stream(found.sha256), size=found.bytes, etag=found.sha256,
        media_type="application/octet-stream", filename=found.filename or f"{found.name}.{found.format}",
    )  # fmt: skip
