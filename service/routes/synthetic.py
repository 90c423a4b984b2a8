"""The synthetic set at one stroke, for a service that has nothing yet."""

from __future__ import annotations

from typing import Any

from starlette.requests import Request
from starlette.responses import Response

from service.auth import Writer
from service.context import Here
from service.replay import json_response, once, same_request
from service.routes.common import CollectionPath, IdempotencyKey, api_router, open_collection
from service.schemas.evaluations import SyntheticBody
from service.schemas.tasks import TaskValue
from service.values import task_value
from store import tasks

__all__ = ["router"]

router = api_router("shapes")

_QUEUED: dict[int | str, dict[str, Any]] = {
    202: {
        "description": "Queued.",
        "headers": {"Location": {"description": "The task.", "schema": {"type": "string"}}},
    }
}


@router.post(
    "/collections/{collection}/synthetic", operation_id="addSyntheticSet", summary="Add the synthetic set",
    status_code=202, response_model=TaskValue, responses=_QUEUED,
)  # fmt: skip
def add_synthetic(
    request: Request, here: Here, principal: Writer, collection: CollectionPath, body: SyntheticBody,
    idempotency_key: IdempotencyKey = None,
) -> Response:  # fmt: skip
    """Ten articulated classes, posed at random, the same for the same seed; the worker makes one shape after another.

    Each is labelled with its class and tagged `synthetic`; one whose bytes are there already is left as it is.
    """
    options = body.model_dump(exclude_none=True)
    asked = same_request(request, principal, idempotency_key, options)
    with here.database.write() as conn:
        opened = open_collection(conn, principal, collection)

        def work() -> Response:
            params = {"synthetic": options, "owner": principal.key_id}
            task = tasks.enqueue(conn, "synthesise", collection_id=opened.id, params=params)
            return json_response(task_value(conn, task), 202, {"Location": f"/v1/tasks/{task.id}"})

        return once(conn, here, asked, work)
