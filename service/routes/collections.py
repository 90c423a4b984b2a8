"""Collections: make, list, look, change, delete."""

from __future__ import annotations

from typing import Any

from starlette.requests import Request
from starlette.responses import Response

from service.auth import Admin, Reader, Writer
from service.context import Here
from service.replay import json_response, once, same_request
from service.routes.common import (
    CollectionPath,
    Cursor,
    IdempotencyKey,
    PageSize,
    api_router,
    open_collection,
)
from service.schemas.collections import CollectionPatch, CollectionValue, NewCollection
from service.schemas.common import PageOf
from service.values import collection_value
from store import collections

__all__ = ["router"]

router = api_router("collections")

_LOCATION: dict[str, Any] = {"Location": {"description": "Where it is.", "schema": {"type": "string"}}}


@router.post(
    "/collections", operation_id="createCollection", summary="Make a collection", status_code=201,
    response_model=CollectionValue, responses={201: {"description": "Made.", "headers": _LOCATION}},
)  # fmt: skip
def create_collection(
    request: Request,
    here: Here,
    principal: Writer,
    body: NewCollection,
    idempotency_key: IdempotencyKey = None,
) -> Response:
    """An empty collection; all its shapes go through the pipeline with its profile."""
    principal.need_everywhere()
    profile = body.profile.given()
    asked = same_request(request, principal, idempotency_key, body.model_dump())
    with here.database.write() as conn:

        def work() -> Response:
            made = collections.create(conn, body.name, profile, body.description)
            location = {"Location": f"/v1/collections/{made.name}"}
            return json_response(collection_value(conn, made), 201, location)

        return once(conn, here, asked, work)


@router.get("/collections", operation_id="listCollections", summary="Collections, oldest first")
def list_collections(
    here: Here, principal: Reader, limit: PageSize = 50, cursor: Cursor = None
) -> PageOf[CollectionValue]:
    """All collections that the key opens."""
    with here.database.read() as conn:
        if principal.collection is not None:
            only = collections.get(conn, principal.collection)
            return PageOf(items=[collection_value(conn, only)], next=None)
        page = collections.list_page(conn, limit=limit, cursor=cursor)
        return PageOf(items=[collection_value(conn, one) for one in page.items], next=page.next)


@router.get("/collections/{collection}", operation_id="getCollection", summary="A collection")
def get_collection(here: Here, principal: Reader, collection: CollectionPath) -> CollectionValue:
    """Its profile, and how many shapes it has by state and by endpoint count."""
    with here.database.read() as conn:
        return collection_value(conn, open_collection(conn, principal, collection))


@router.patch("/collections/{collection}", operation_id="updateCollection", summary="Change a collection")
def update_collection(
    here: Here, principal: Writer, collection: CollectionPath, body: CollectionPatch
) -> CollectionValue:
    """Another profile queues every shape to be described again; parameters that it does not name stay."""
    profile = None if body.profile is None else body.profile.given()
    with here.database.write() as conn:
        open_collection(conn, principal, collection)
        changed = collections.update(conn, collection, description=body.description, profile=profile)
        return collection_value(conn, changed)


@router.delete(
    "/collections/{collection}",
    operation_id="deleteCollection",
    summary="Delete a collection",
    status_code=204,
)
def delete_collection(here: Here, principal: Admin, collection: CollectionPath) -> None:
    """With all its shapes; what is queued for them is cancelled."""
    with here.database.write() as conn:
        open_collection(conn, principal, collection)
        collections.delete(conn, collection)
