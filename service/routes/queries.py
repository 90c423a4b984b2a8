"""Queries: by a stored shape, by a mesh that is not kept, in batches."""

from __future__ import annotations

from typing import Any

from pydantic import Field
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from reebase.errors import ReebaseError
from reebase.ranking import ranking_named
from service.auth import Principal, Reader
from service.checks import check_query
from service.context import Context, Here
from service.errors import InvalidRequest
from service.forms import model_of_fields, model_of_json
from service.problems import problem_response, value_of
from service.replay import json_response
from service.routes.common import CollectionPath, IdempotencyKey, api_router, open_collection
from service.routes.documents import QUERY
from service.routes.unkept import answer_of_task, enqueue
from service.schemas.common import Body, Finite
from service.schemas.queries import (
    AnswerValue,
    BatchBody,
    BatchValue,
    PendingAnswer,
    QueryBody,
    QueryParameters,
)
from service.strict import is_json
from service.uploads import received
from store.answers import answer_query
from store.descriptors import SRG
from store.query import QuerySpec
from store.records import Task

__all__ = ["router"]

router = api_router("queries")

_TOLERANCE = {SRG: 2}
"""By how much endpoint counts may differ where the query does not say (Kacem, section 4.3.1)."""

_OF_THE_FILE = frozenset({"format", "filename", "wait"})

_ANSWERS: dict[int | str, dict[str, Any]] = {
    200: {"description": "The answer.", "model": AnswerValue},
    202: {
        "description": "The mesh is still being described; the task will hold the answer.",
        "model": PendingAnswer,
        "headers": {"Location": {"description": "The task.", "schema": {"type": "string"}}},
    },
}


class _Wait(Body):
    wait: Finite = Field(30.0, ge=0, le=60)


@router.post(
    "/collections/{collection}/query", operation_id="query", summary="Which shapes are like this one?",
    response_model=AnswerValue, responses=_ANSWERS, openapi_extra=QUERY,
)  # fmt: skip
async def query(
    request: Request, here: Here, principal: Reader, collection: CollectionPath,
    idempotency_key: IdempotencyKey = None,
) -> Response:  # fmt: skip
    """The k most similar shapes, each with what the parts of the ranking say of it, D(G, G̃) and the matched endpoints.

    Send JSON to ask by the id of a shape, or a mesh (multipart or its bytes) that is not kept. A query by
    mesh that is not done within `wait` seconds is answered with its task.
    """
    await run_in_threadpool(_check_open, here, principal, collection)
    if is_json(request):
        body = model_of_json(QueryBody, await request.json())
        return await run_in_threadpool(_by_shape, here, collection, body)
    async with received(request, here.blobs, here.settings.max_upload_bytes, or_json=True) as upload:
        parameters = model_of_fields(QueryParameters, upload.fields, leave=_OF_THE_FILE)
        check_query(parameters, here.settings, form=True)
        wait = model_of_fields(_Wait, {k: v for k, v in upload.fields.items() if k == "wait"}).wait
        params = {**_spec(collection, parameters, None).to_params(), "format": upload.format}
        enqueued = await run_in_threadpool(
            enqueue, request, here, principal, upload, "query", params, idempotency_key, PendingAnswer, collection
        )
    return await answer_of_task(request, here, enqueued, wait, _answer, PendingAnswer)


def _check_open(here: Context, principal: Principal, collection: str) -> None:
    with here.database.read() as conn:
        open_collection(conn, principal, collection)


def _spec(collection: str, value: QueryParameters, shape: str | None) -> QuerySpec:
    ranking = ranking_named(value.descriptor, value.measure, value.rerank)
    tolerance = value.tolerance if "tolerance" in value.model_fields_set else _TOLERANCE.get(ranking.name)
    return QuerySpec(
        collection, shape, k=value.k, tolerance=tolerance, descriptor=ranking.name, measure=ranking.measure,
        rerank=ranking.rerank, label=value.label, tags=tuple(value.tags), metadata=value.metadata,
        max_dissimilarity=value.max_dissimilarity,
    )  # fmt: skip


def _answer(task: Task) -> AnswerValue:
    return AnswerValue.model_validate(task.result)


def _by_shape(here: Context, collection: str, body: QueryBody) -> Response:
    check_query(body, here.settings)
    answer = answer_query(here.database, here.follower, _spec(collection, body, body.shape))
    return json_response(AnswerValue.model_validate(answer))


@router.post(
    "/collections/{collection}/queries", operation_id="queryBatch", summary="Several queries at once"
)
def query_batch(
    request: Request, here: Here, principal: Reader, collection: CollectionPath, body: BatchBody
) -> BatchValue:
    """Queries by shape; each has its answer or its own problem, in their order."""
    with here.database.read() as conn:
        open_collection(conn, principal, collection)
    limit = here.settings.max_batch
    if len(body.queries) > limit:
        detail = f"queries: there are {len(body.queries)}; at most {limit} are allowed"
        raise InvalidRequest([{"detail": detail, "code": "too_many", "pointer": "/queries"}])
    # A query that asks for more than max_k is refused by itself, and so has no hits.
    hits, most = sum(q.k for q in body.queries if q.k <= here.settings.max_k), here.settings.max_batch_hits
    if hits > most:
        detail = f"queries: they ask for {hits} hits together (the sum of k); at most {most} are allowed in a batch"
        raise InvalidRequest([{"detail": detail, "code": "too_many", "pointer": "/queries"}])
    return BatchValue.model_validate(
        {"results": [_one(request, here, collection, i, q) for i, q in enumerate(body.queries)]}
    )


def _one(request: Request, here: Context, collection: str, index: int, body: QueryBody) -> dict[str, Any]:
    try:
        check_query(body, here.settings, prefix=("queries", index))
        answer = answer_query(here.database, here.follower, _spec(collection, body, body.shape))
        return {"answer": answer, "problem": None}
    except ReebaseError as error:
        if problem_response(request, error).status_code >= 500:
            raise
        return {"answer": None, "problem": value_of(request, error)}
