"""Many shapes at once: label, delete, restore."""

from __future__ import annotations

from datetime import timedelta

from sqlalchemy import Connection

from reebase.errors import ReebaseError
from service.auth import Reader, Writer
from service.checks import check_label
from service.context import Here
from service.routes.common import CollectionPath, IdPath, api_router, open_collection
from service.schemas.bulk import (
    BulkLabel,
    DeletedValue,
    LabelCount,
    LabelledValue,
    LabelsValue,
    Refusal,
    RestoredValue,
    ShapeIds,
)
from service.schemas.shapes import ShapeValue
from service.values import shape_value
from store import keys, shapes
from store.records import Shape
from store.sql import read_clock

__all__ = ["router"]

router = api_router("shapes")


@router.get("/collections/{collection}/labels", operation_id="listLabels", summary="Labels")
def list_labels(here: Here, principal: Reader, collection: CollectionPath) -> LabelsValue:
    """Every label with the number of its shapes, most first."""
    with here.database.read() as conn:
        found = shapes.labels(conn, open_collection(conn, principal, collection).id)
    return LabelsValue(items=[LabelCount(label=label, shapes=count) for label, count in found])


@router.post("/collections/{collection}/bulk/label", operation_id="labelShapes", summary="Label many shapes")
def label_shapes(here: Here, principal: Writer, collection: CollectionPath, body: BulkLabel) -> LabelledValue:
    """All of them get the label, or lose theirs; ids that are not there are passed over."""
    with here.database.write() as conn:
        opened = open_collection(conn, principal, collection)
        check_label(body.label, here.settings)
        return LabelledValue(labelled=shapes.label_many(conn, opened.id, body.shapes, body.label))


@router.post("/collections/{collection}/bulk/delete", operation_id="deleteShapes", summary="Delete many shapes")
def delete_shapes(here: Here, principal: Writer, collection: CollectionPath, body: ShapeIds) -> DeletedValue:
    """As each by itself; ids that are not there are passed over."""
    with here.database.write() as conn:
        opened = open_collection(conn, principal, collection)
        there = shapes.by_ids(conn, body.shapes)
        wanted = [shape.id for shape in there.values() if shape.collection_id == opened.id]
        for shape_id in wanted:
            shapes.delete(conn, opened.id, shape_id)
        until = read_clock(conn) + timedelta(seconds=here.settings.keep_deleted_seconds)
    return DeletedValue(deleted=wanted, restorable_until=until)


@router.post("/collections/{collection}/bulk/restore", operation_id="restoreShapes", summary="Restore many shapes")
def restore_shapes(here: Here, principal: Writer, collection: CollectionPath, body: ShapeIds) -> RestoredValue:
    """As each by itself; what cannot be restored is named with its reason."""
    restored: list[str] = []
    refused: list[Refusal] = []
    with here.database.write() as conn:
        opened = open_collection(conn, principal, collection)
        for shape_id in dict.fromkeys(body.shapes):
            try:
                with conn.begin_nested():
                    _restore(conn, opened.id, shape_id)
            except ReebaseError as error:
                refused.append(Refusal(shape=shape_id, code=error.code, detail=error.message))
            else:
                restored.append(shape_id)
    return RestoredValue(restored=restored, refused=refused)


@router.post(
    "/collections/{collection}/shapes/{shape}/restore", operation_id="restoreShape", summary="Restore a shape"
)
def restore_shape(here: Here, principal: Writer, collection: CollectionPath, shape: IdPath) -> ShapeValue:
    """Undo its deletion, within a day of it; a shape that is there stays as it is.

    `shape_exists`: its bytes were uploaded again meanwhile. `quota_exceeded`: its place is taken.
    """
    with here.database.write() as conn:
        opened = open_collection(conn, principal, collection)
        return shape_value(conn, opened, _restore(conn, opened.id, shape))


def _restore(conn: Connection, collection_id: str, shape_id: str) -> Shape:
    """Raises ShapeNotFound, ShapeExists; QuotaExceeded for what it counts towards."""
    if shape_id in shapes.by_ids(conn, [shape_id]):
        return shapes.get(conn, collection_id, shape_id)
    restored = shapes.restore(conn, collection_id, shape_id)
    if restored.owner is not None:
        keys.check_quota(conn, keys.get(conn, restored.owner), adding=0)
    return restored
