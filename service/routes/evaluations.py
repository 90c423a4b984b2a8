"""Evaluations: start, list, look, the matrix, delete."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
from sqlalchemy import Connection
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

from reebase.pipeline import Profile
from reebase.ranking import ranking_named
from service.auth import Principal, Reader, Writer
from service.conditional import unless_unchanged
from service.context import Here
from service.replay import json_response, once, same_request
from service.routes.common import Cursor, IdempotencyKey, IdPath, PageSize, api_router, open_collection
from service.schemas.common import PageOf
from service.schemas.evaluations import EvaluationValue, MatrixValue, NewEvaluation
from service.values import evaluation_value
from store import descriptors, evaluations
from store.errors import EvaluationNotFound
from store.records import Evaluation

__all__ = ["router", "visible_evaluation"]

router = api_router("evaluations")

_STARTED: dict[int | str, dict[str, Any]] = {
    202: {
        "description": "Queued.",
        "headers": {"Location": {"description": "The evaluation.", "schema": {"type": "string"}}},
    }
}


def visible_evaluation(conn: Connection, principal: Principal, evaluation_id: str) -> Evaluation:
    """Raises EvaluationNotFound, also for one of a collection that the key does not open."""
    found = evaluations.get(conn, evaluation_id)
    if not principal.sees(found.collection_id):
        raise EvaluationNotFound(f"There is no evaluation {evaluation_id[:80]!r}.")
    return found


@router.post(
    "/evaluations", operation_id="createEvaluation", summary="Evaluate retrieval", status_code=202,
    response_model=EvaluationValue, responses=_STARTED,
)  # fmt: skip
def create_evaluation(
    request: Request,
    here: Here,
    principal: Writer,
    body: NewEvaluation,
    idempotency_key: IdempotencyKey = None,
) -> Response:
    """Leave-one-out over a collection with labels or over the synthetic set; a task with progress."""
    if body.collection is None:
        principal.need_everywhere()
    ranking = ranking_named(body.descriptor, body.measure, body.rerank)
    params = {
        **body.model_dump(exclude_none=True),
        "descriptor": ranking.name, "measure": ranking.measure, "rerank": ranking.rerank,
    }  # fmt: skip
    if body.profile is not None:
        params["profile"] = {**Profile().to_json(), **body.profile.given()}
    asked = same_request(request, principal, idempotency_key, params)
    with here.database.write() as conn:
        opened = None if body.collection is None else open_collection(conn, principal, body.collection)

        def work() -> Response:
            if opened is not None:
                descriptors.check_any(conn, opened, ranking.parts)
            made = evaluations.create(
                conn, params=params, collection_id=None if opened is None else opened.id
            )
            location = {"Location": f"/v1/evaluations/{made.id}"}
            return json_response(evaluation_value(conn, made), 202, location)

        return once(conn, here, asked, work)


@router.get("/evaluations", operation_id="listEvaluations", summary="Evaluations, newest first")
def list_evaluations(
    here: Here, principal: Reader, limit: PageSize = 20, cursor: Cursor = None
) -> PageOf[EvaluationValue]:
    """All evaluations that the key may see, without their reports."""
    with here.database.read() as conn:
        page = evaluations.list_page(conn, limit=limit, cursor=cursor, collection_id=principal.collection_id)
        return PageOf(items=[evaluation_value(conn, one) for one in page.items], next=page.next)


@router.get("/evaluations/{evaluation}", operation_id="getEvaluation", summary="An evaluation")
def get_evaluation(here: Here, principal: Reader, evaluation: IdPath) -> EvaluationValue:
    """Its task with state and progress and, once that succeeded, the report."""
    with here.database.read() as conn:
        return evaluation_value(conn, visible_evaluation(conn, principal, evaluation))


@router.get(
    "/evaluations/{evaluation}/matrix", operation_id="getMatrix", summary="Dissimilarity matrix",
    response_model=MatrixValue,
)  # fmt: skip
def get_matrix(request: Request, here: Here, principal: Reader, evaluation: IdPath) -> Response:
    """D of all pairs, with the names and labels of rows and columns."""
    with here.database.read() as conn:
        found = visible_evaluation(conn, principal, evaluation)
    sha256 = evaluations.matrix_of(found)

    def make() -> Response:
        rows = evaluations.matrix_rows(here.blobs, sha256)
        return StreamingResponse(_matrix_json(found, rows), media_type="application/json")

    return unless_unchanged(request, f"{sha256}-json", make)


def _matrix_json(found: Evaluation, rows: Iterator[npt.NDArray[np.float64]]) -> Iterator[str]:
    """Row by row: the matrix of some thousand shapes has more text than a service should hold at once."""
    yield f'{{"id": {json.dumps(found.id)}, "items": {json.dumps(found.items or [])}, "matrix": ['
    for number, row in enumerate(rows):
        yield ("," if number else "") + json.dumps(row.tolist(), allow_nan=False)
    yield "]}"


@router.delete(
    "/evaluations/{evaluation}",
    operation_id="deleteEvaluation",
    summary="Delete an evaluation",
    status_code=204,
)
def delete_evaluation(here: Here, principal: Writer, evaluation: IdPath) -> None:
    """With its task, which stops if it runs, and its matrix."""
    with here.database.write() as conn:
        visible_evaluation(conn, principal, evaluation)
        evaluations.delete(conn, evaluation)
