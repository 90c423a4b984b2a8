"""Evaluations side by side as one page: have it made, read it."""

from __future__ import annotations

from typing import Any

from sqlalchemy import Connection
from starlette.requests import Request
from starlette.responses import Response

from reebase.errors import ParameterError
from service.auth import Principal, Reader, Writer
from service.conditional import unless_unchanged
from service.context import Here
from service.downloads import file_response
from service.replay import json_response, once, same_request
from service.routes.common import IdempotencyKey, IdPath, api_router
from service.routes.evaluations import visible_evaluation
from service.routes.tasks import visible_task
from service.schemas.reports import NewReport
from service.schemas.tasks import TaskValue
from service.values import task_value
from store import evaluations, outputs, tasks
from store.errors import TaskNotFound
from store.records import Evaluation

__all__ = ["router"]

router = api_router("evaluations")

# A page of its own, with its style inside and without any script.
_ALONE = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; sandbox; frame-ancestors 'none'"

_QUEUED: dict[int | str, dict[str, Any]] = {
    202: {
        "description": "Queued.",
        "headers": {"Location": {"description": "The report.", "schema": {"type": "string"}}},
    }
}
_PAGE: dict[int | str, dict[str, Any]] = {
    200: {"description": "The page.", "content": {"text/html": {"schema": {"type": "string"}}}},
    304: {"description": "Not modified."},
}
_FILES: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The files.",
        "content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}},
    },
    304: {"description": "Not modified."},
}


@router.post(
    "/reports", operation_id="createReport", summary="Put evaluations side by side", status_code=202,
    response_model=TaskValue, responses=_QUEUED,
)  # fmt: skip
def create_report(
    request: Request, here: Here, principal: Writer, body: NewReport, idempotency_key: IdempotencyKey = None
) -> Response:
    """One page with precision and recall, scores with intervals, classes, matrices and retrieved shapes; a task."""
    asked = same_request(request, principal, idempotency_key, body.model_dump())
    with here.database.write() as conn:
        found = [visible_evaluation(conn, principal, one) for one in dict.fromkeys(body.evaluations)]
        _check_alike(found)

        def work() -> Response:
            title = body.title or found[0].params.get("collection") or "synthetic set"
            params = {"evaluations": [one.id for one in found], "title": title}
            task = tasks.enqueue(conn, "report", collection_id=found[0].collection_id, params=params)
            return json_response(task_value(conn, task), 202, {"Location": f"/v1/reports/{task.id}"})

        return once(conn, here, asked, work)


def _check_alike(found: list[Evaluation]) -> None:
    """All matrices are scored by the labels of the first.

    Raises ResultNotFound for one that has not succeeded, ParameterError for one of other shapes or labels.
    """
    first = _labels(found[0])
    for one in found:
        evaluations.matrix_of(one)
        labels = _labels(one)
        if labels == first:
            continue
        apart = "are not of the same shapes"
        if [shape for shape, _ in labels] == [shape for shape, _ in first]:
            changed = sum(before != after for before, after in zip(labels, first, strict=True))
            apart = f"are of different labels: {changed} of {len(first)} shapes changed theirs between them"
        raise ParameterError(
            f"The evaluations {found[0].id} and {one.id} {apart}; evaluate both again.", parameter="evaluations"
        )


def _labels(one: Evaluation) -> list[tuple[str, str]]:
    return [(item["id"], item["label"]) for item in one.items or []]


@router.get(
    "/reports/{task}", operation_id="getReport", summary="A report as a page", response_class=Response,
    responses=_PAGE,
)  # fmt: skip
def get_report(request: Request, here: Here, principal: Reader, task: IdPath) -> Response:
    """HTML that needs nothing else: no script and no network. Kept as long as its task."""
    with here.database.read() as conn:
        sha256 = _output(conn, principal, task, "page")
    headers = {"Content-Security-Policy": _ALONE}
    return unless_unchanged(
        request, sha256, lambda: Response(here.blobs.get(sha256), media_type="text/html", headers=headers)
    )


@router.get(
    "/reports/{task}/files", operation_id="getReportFiles", summary="A report as files", response_class=Response,
    responses=_FILES,
)  # fmt: skip
def get_files(request: Request, here: Here, principal: Reader, task: IdPath) -> Response:
    """A ZIP archive of the page, `report.json` and each plot as SVG."""
    with here.database.read() as conn:
        sha256 = _output(conn, principal, task, "files")
    return file_response(
        request, lambda: here.blobs.get(sha256), etag=sha256, media_type="application/zip", filename="report.zip"
    )


def _output(conn: Connection, principal: Principal, task: str, name: str) -> str:
    found = visible_task(conn, principal, task)
    if found.kind != "report":
        raise TaskNotFound(f"The task {found.id} makes no report; it is of the kind {found.kind}.")
    return outputs.find(conn, found, name)
