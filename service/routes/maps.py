"""A collection as a map: look at it, have it made."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Query
from sqlalchemy import Connection
from starlette.responses import Response

from reebase.errors import unknown_name
from service.auth import Reader, Writer
from service.context import Here
from service.replay import json_response
from service.routes.common import CollectionPath, api_router, open_collection
from service.schemas.maps import MapBody, MapPoint, MapValue, rankings
from service.schemas.tasks import TaskValue
from service.values import task_value
from store import descriptors, maps, shapes, tasks
from store.records import Collection, Task

__all__ = ["router"]

router = api_router("collections")

_ANSWERS: dict[int | str, dict[str, Any]] = {
    200: {"description": "It is current, or being made.", "model": TaskValue},
    202: {"description": "Queued."},
}


def _descriptor(conn: Connection, collection: Collection, asked: str | None) -> str:
    """What was asked for, or the default of queries where all described shapes have its parts."""
    from reebase.ranking import DEFAULT, ranking_named

    if asked is not None:
        return asked
    parts = tuple(ranking_named(DEFAULT).parts)
    found = descriptors.coverage(conn, collection, (descriptors.SRG, *parts))
    whole = all(found[part] == found[descriptors.SRG] for part in parts)
    return DEFAULT if whole else descriptors.SRG


def _is_current(conn: Connection, collection: Collection, task: Task | None) -> bool:
    return task is not None and (task.result or {}).get("stamp") == maps.stamp(conn, collection)


@router.get("/collections/{collection}/map", operation_id="getMap", summary="Map of a collection")
def get_map(
    here: Here, principal: Reader, collection: CollectionPath,
    descriptor: Annotated[str | None, Query(description="By what it was made; as for a query.")] = None,
) -> MapValue:  # fmt: skip
    """The latest map, with the names and labels that shapes have now; those that were deleted since are left out."""
    with here.database.read() as conn:
        opened = open_collection(conn, principal, collection)
        if descriptor is not None and descriptor not in rankings():
            raise unknown_name("descriptor", descriptor[:80], rankings())
        chosen = _descriptor(conn, opened, descriptor)
        newest, done = maps.latest(conn, opened.id, chosen)
        found = (done.result or {}) if done is not None else {}
        there = shapes.summaries(conn, opened.id, [point[0] for point in found.get("points", ())])
        points = [
            MapPoint(shape=shape_id, name=there[shape_id][0], label=there[shape_id][1], x=x, y=y)
            for shape_id, x, y in found.get("points", ()) if shape_id in there
        ]  # fmt: skip
        state = "none" if done is None else "current" if _is_current(conn, opened, done) else "outdated"
        pending = None if newest is None or newest.state == "succeeded" else task_value(conn, newest)
    return MapValue(
        state=state, descriptor=chosen, task=pending, made_at=None if done is None else done.finished_at,
        left_out=found.get("left_out", 0), neighbours_kept=found.get("neighbours_kept"), points=points,
    )  # fmt: skip


@router.post(
    "/collections/{collection}/map", operation_id="makeMap", summary="Make the map of a collection", status_code=202,
    response_model=TaskValue, responses=_ANSWERS,
)  # fmt: skip
def make_map(here: Here, principal: Writer, collection: CollectionPath, body: MapBody) -> Response:
    """Queue it, unless it is current or being made already. The same shapes give the same map."""
    with here.database.write() as conn:
        opened = open_collection(conn, principal, collection)
        chosen = _descriptor(conn, opened, body.descriptor)
        newest, done = maps.latest(conn, opened.id, chosen)
        if newest is not None and not newest.ended:
            return json_response(task_value(conn, newest), 200)
        if done is not None and _is_current(conn, opened, done):
            return json_response(task_value(conn, done), 200)
        task = tasks.enqueue(conn, "map", collection_id=opened.id, params={"descriptor": chosen})
        return json_response(task_value(conn, task), 202, {"Location": f"/v1/tasks/{task.id}"})
