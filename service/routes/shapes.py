"""Shapes: upload, list, look, change, delete."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import Query
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from service.auth import Principal, Reader, Writer
from service.checks import check_attributes
from service.context import Context, Here
from service.forms import model_of_fields
from service.replay import json_response, once, same_request
from service.routes.common import (
    CollectionPath,
    Cursor,
    IdempotencyKey,
    IdPath,
    PageSize,
    api_router,
    open_collection,
)
from service.routes.documents import UPLOAD
from service.schemas.shapes import Attributes, ShapePage, ShapePatch, ShapeValue, UploadValue
from service.uploads import Upload, received
from service.values import shape_value, shape_values, task_value
from store import faults, keys, shapes, tasks
from store.records import Filters

__all__ = ["router"]

router = api_router("shapes")

Sort = Literal[
    "created", "-created", "name", "-name", "label", "-label", "endpoints", "-endpoints", "bytes", "-bytes"
]

_OF_THE_FILE = frozenset({"format", "filename"})

_UPLOADED: dict[int | str, dict[str, Any]] = {
    200: {"description": "These bytes are there already: the same shape, as it is.", "model": UploadValue},
    202: {
        "description": "Stored and queued.",
        "headers": {"Location": {"description": "Where the shape is.", "schema": {"type": "string"}}},
    },
}


@router.post(
    "/collections/{collection}/shapes", operation_id="uploadShape", summary="Upload a mesh", status_code=202,
    response_model=UploadValue, responses=_UPLOADED, openapi_extra=UPLOAD,
)  # fmt: skip
async def upload_shape(
    request: Request, here: Here, principal: Writer, collection: CollectionPath,
    idempotency_key: IdempotencyKey = None,
) -> Response:  # fmt: skip
    """Store a mesh and queue its description.

    Send multipart/form-data with a part `file` and fields, or the bytes themselves with query parameters.
    """
    await run_in_threadpool(_check_open, here, principal, collection)
    async with received(request, here.blobs, here.settings.max_upload_bytes) as upload:
        attributes = model_of_fields(Attributes, upload.fields, leave=_OF_THE_FILE)
        check_attributes(attributes, here.settings, form=True)
        return await run_in_threadpool(
            _store, request, here, principal, collection, upload, attributes, idempotency_key
        )


def _check_open(here: Context, principal: Principal, collection: str) -> None:
    # Before a byte of the body is read.
    with here.database.read() as conn:
        open_collection(conn, principal, collection)


def _store(
    request: Request, here: Context, principal: Principal, collection: str, upload: Upload,
    attributes: Attributes, idempotency_key: str | None,
) -> Response:  # fmt: skip
    """Blob, then row and task in one transaction, then the answer."""
    sha256 = upload.keep()
    faults.point("upload.blob_stored")
    body = {"sha256": sha256, "format": upload.format, "filename": upload.filename, **attributes.model_dump()}
    asked = same_request(request, principal, idempotency_key, body)
    with here.database.write() as conn:
        opened = open_collection(conn, principal, collection)

        def work() -> Response:
            upload.check_kept(sha256)
            shape, created = shapes.add(
                conn, opened.id, sha256=sha256, bytes=upload.size, format=upload.format,
                name=attributes.name or upload.filename or sha256[:12], filename=upload.filename,
                label=attributes.label, tags=attributes.tags, metadata=attributes.metadata,
                owner=principal.key_id,
            )  # fmt: skip
            if created:
                if principal.key is not None:
                    keys.check_quota(
                        conn, principal.key, adding=0
                    )  # the shape is among those that are counted
                tasks.enqueue(conn, "describe", collection_id=opened.id, shape_id=shape.id)
                shape = shapes.get(conn, opened.id, shape.id)
            task = None if shape.task_id is None else task_value(conn, tasks.get(conn, shape.task_id))
            value = UploadValue(shape=shape_value(conn, opened, shape), task=task)
            location = {"Location": f"/v1/collections/{opened.name}/shapes/{shape.id}"}
            return json_response(value, 202 if created else 200, location)

        response = once(conn, here, asked, work)
    faults.point("upload.row_committed")
    return response


@router.get("/collections/{collection}/shapes", operation_id="listShapes", summary="Shapes")
def list_shapes(
    here: Here, principal: Reader, collection: CollectionPath, limit: PageSize = 50, cursor: Cursor = None,
    label: Annotated[str | None, Query(description="Only shapes with this label.")] = None,
    tag: Annotated[
        list[str] | None, Query(description="Only shapes with all of these.", max_length=32)
    ] = None,
    state: Literal["queued", "running", "indexed", "failed", "cancelled"] | None = None,
    sha256: Annotated[str | None, Query(description="Of the uploaded bytes.")] = None,
    text: Annotated[
        str | None, Query(description="Stands in name, file name or label.", min_length=1, max_length=200)
    ] = None,
    unlabelled: Annotated[bool, Query(description="Only shapes without a label.")] = False,
    sort: Annotated[Sort, Query(description="A `-` before it turns the order round.")] = "created",
) -> ShapePage:  # fmt: skip
    """All shapes, or those that the filters let pass; `total` is how many these are."""
    filters = Filters(
        label=label, tags=tuple(tag or ()), state=state, sha256=sha256, text=text, unlabelled=unlabelled
    )
    with here.database.read() as conn:
        opened = open_collection(conn, principal, collection)
        page = shapes.list_page(conn, opened.id, filters, limit=limit, cursor=cursor, sort=sort)
        total = shapes.count(conn, opened.id, filters)
        return ShapePage(items=shape_values(conn, opened, page.items), next=page.next, total=total)


@router.get("/collections/{collection}/shapes/{shape}", operation_id="getShape", summary="A shape")
def get_shape(here: Here, principal: Reader, collection: CollectionPath, shape: IdPath) -> ShapeValue:
    """Its state, what was said about it, and why it failed if it did."""
    with here.database.read() as conn:
        opened = open_collection(conn, principal, collection)
        return shape_value(conn, opened, shapes.get(conn, opened.id, shape))


@router.patch(
    "/collections/{collection}/shapes/{shape}", operation_id="updateShape", summary="Change a shape"
)
def update_shape(
    here: Here, principal: Writer, collection: CollectionPath, shape: IdPath, body: ShapePatch
) -> ShapeValue:
    """Name, label, tags or metadata; tags and metadata are replaced whole."""
    check_attributes(body, here.settings, form=False)
    with here.database.write() as conn:
        opened = open_collection(conn, principal, collection)
        changed = shapes.update(conn, opened.id, shape, **body.model_dump(exclude_unset=True))
        return shape_value(conn, opened, changed)


@router.delete(
    "/collections/{collection}/shapes/{shape}",
    operation_id="deleteShape",
    summary="Delete a shape",
    status_code=204,
)
def delete_shape(here: Here, principal: Writer, collection: CollectionPath, shape: IdPath) -> None:
    """The shape and all that was learnt of it; what is queued for it is cancelled.

    For a day it can be restored; to everything else it is gone at once.
    """
    with here.database.write() as conn:
        shapes.delete(conn, open_collection(conn, principal, collection).id, shape)
