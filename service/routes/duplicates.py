"""Near-duplicates of a collection: look at them, have them sought."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

from fastapi import Query
from starlette.responses import Response

from service.auth import Reader, Writer
from service.context import Here
from service.replay import json_response
from service.routes.common import CollectionPath, api_router, open_collection
from service.schemas.duplicates import DuplicatesValue, FindingValue, FoundShape
from service.schemas.tasks import TaskValue
from service.values import task_value
from store import duplicates, maps, shapes, tasks

__all__ = ["router"]

router = api_router("collections")

_CONFIDENCES = ("certain", "strong", "fair")

_ANSWERS: dict[int | str, dict[str, Any]] = {
    200: {"description": "They are current, or being sought.", "model": TaskValue},
    202: {"description": "Queued."},
}


@router.get("/collections/{collection}/duplicates", operation_id="getDuplicates", summary="Near-duplicates")
def get_duplicates(
    here: Here, principal: Reader, collection: CollectionPath,
    shape: Annotated[str | None, Query(max_length=64, description="Only findings with this shape.")] = None,
    confidence: Annotated[
        Literal["certain", "strong", "fair"], Query(description="Only findings that are at least so sure.")
    ] = "fair",
    limit: Annotated[int, Query(ge=1, le=1000, description="Findings at most.")] = 100,
) -> DuplicatesValue:  # fmt: skip
    """Shapes that are one: exported again, moved, rescaled, mirrored, remeshed, decimated, several in one file.

    Those of the latest search, without shapes that were deleted since, with the names that shapes have now. Of more
    than 2,000 findings the strongest 2,000 are there; ``total`` counts the others too.
    """
    sure = _CONFIDENCES[: _CONFIDENCES.index(confidence) + 1]
    with here.database.read() as conn:
        opened = open_collection(conn, principal, collection)
        newest, done = duplicates.latest(conn, opened.id)
        found = (done.result or {}) if done is not None else {}
        every = [*found.get("findings", ()), *found.get("weaker", ())]
        there = shapes.summaries(conn, opened.id, sorted({one[side] for one in every for side in ("first", "second")}))
        passed = [
            one for one in every
            if {one["first"], one["second"]} <= there.keys() and one["confidence"] in sure
            and (shape is None or shape in (one["first"], one["second"]))
        ]  # fmt: skip
        kept = [one for one in passed if "words" in one]
        current = found.get("stamp") == maps.stamp(conn, opened)
        pending = None if newest is None or newest.state == "succeeded" else task_value(conn, newest)
    return DuplicatesValue(
        state="none" if done is None else "current" if current else "outdated", task=pending,
        made_at=None if done is None else done.finished_at, compared=found.get("compared", 0),
        left_out=found.get("left_out", 0), pairs=found.get("pairs", 0), pairs_left_out=found.get("pairs_left_out", 0),
        total=len(passed),
        findings=[_finding(one, there) for one in kept[:limit]],
    )  # fmt: skip


@router.post(
    "/collections/{collection}/duplicates", operation_id="findDuplicates", summary="Seek near-duplicates",
    status_code=202, response_model=TaskValue, responses=_ANSWERS,
)  # fmt: skip
def find_duplicates(here: Here, principal: Writer, collection: CollectionPath) -> Response:
    """Queue the search, unless its findings are current or it is under way. It changes nothing."""
    with here.database.write() as conn:
        opened = open_collection(conn, principal, collection)
        newest, done = duplicates.latest(conn, opened.id)
        if newest is not None and not newest.ended:
            return json_response(task_value(conn, newest), 200)
        if done is not None and (done.result or {}).get("stamp") == maps.stamp(conn, opened):
            return json_response(task_value(conn, done), 200)
        task = tasks.enqueue(conn, "duplicates", collection_id=opened.id)
        return json_response(task_value(conn, task), 202, {"Location": f"/v1/tasks/{task.id}"})


def _finding(one: dict[str, Any], there: dict[str, tuple[str, str | None]]) -> FindingValue:
    """The findings call shapes by their ids: names change, and two may be the same."""
    first, second = (FoundShape(id=id, name=there[id][0], label=there[id][1]) for id in (one["first"], one["second"]))
    shown = {one.id: one.name if first.id == second.id or first.name != second.name else f"{one.name} ({one.id})"
             for one in (first, second)}  # fmt: skip
    words = re.sub("|".join(map(re.escape, shown)), lambda found: shown[found[0]], one["words"])
    return FindingValue(**{**one, "first": first, "second": second, "words": words})
