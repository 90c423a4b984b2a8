"""Pictures of evaluations, and where they went wrong."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import Path, Query
from starlette.requests import Request
from starlette.responses import Response

import reebase
from reebase.errors import unknown_name
from service.auth import Principal, Reader
from service.conditional import unless_unchanged
from service.context import Context, Here
from service.plots import blocks
from service.routes.common import IdPath, api_router
from service.routes.evaluations import visible_evaluation
from service.schemas.plots import ConfusionValue, RankedShape, WorstQuery, WorstValue
from store import evaluations
from store.errors import ResultNotFound
from store.records import Evaluation

__all__ = ["router"]

router = api_router("evaluations")

_PLOTS = ("precision_recall.svg", "matrix.svg", "confusion.svg")

Theme = Annotated[Literal["light", "dark"], Query(description="The ground that it is drawn for.")]

_SVG: dict[int | str, dict[str, Any]] = {
    200: {"description": "The plot.", "content": {"image/svg+xml": {"schema": {"type": "string"}}}},
    304: {"description": "Not modified."},
}


def _found(here: Context, principal: Principal, evaluation: str) -> tuple[Evaluation, dict[str, Any]]:
    """An evaluation and its report. Raises EvaluationNotFound, ResultNotFound."""
    with here.database.read() as conn:
        found = visible_evaluation(conn, principal, evaluation)
    if found.report is None:
        raise ResultNotFound(
            f"The evaluation has no report: its task is {found.task.state}.", evaluation=found.id, task=found.task.id,
            state=found.task.state,
        )  # fmt: skip
    return found, found.report


def _mistakes(found: Evaluation, report: dict[str, Any]) -> dict[str, Any]:
    if "mistakes" not in report:
        raise ResultNotFound("The evaluation was made by a version that did not keep this; evaluate again.",
                             evaluation=found.id)  # fmt: skip
    kept: dict[str, Any] = report["mistakes"]
    return kept


def _title(found: Evaluation, report: dict[str, Any]) -> str:
    """As in ``zoo: srg, matching`` or ``zoo: fused, reranked``."""
    how = "reranked" if report.get("rerank") else report.get("measure")
    ranking = ", ".join(filter(None, (report.get("descriptor", "srg"), how)))
    return f"{found.params.get('collection') or 'synthetic set'}: {ranking}"


def _svg(request: Request, here: Context, name: str, draw: Any) -> Response:
    name = f"{name}-{reebase.__version__}"
    return unless_unchanged(
        request, name, lambda: Response(here.plots.get(name, draw), media_type="image/svg+xml")
    )


@router.get(
    "/evaluations/{evaluation}/plots/{plot}", operation_id="getPlot", summary="Plot of an evaluation",
    response_class=Response, responses=_SVG,
)  # fmt: skip
def get_plot(
    request: Request, here: Here, principal: Reader, evaluation: IdPath,
    plot: Annotated[str, Path(description=", ".join(_PLOTS), examples=["matrix.svg"])], theme: Theme = "light",
) -> Response:  # fmt: skip
    """Precision over recall; D of all pairs, sorted by class; which class is taken for which."""
    from reebase import pictures
    from reebase.pictures.confusion import confusion_plot

    found, report = _found(here, principal, evaluation)
    if plot not in _PLOTS:
        raise unknown_name("plot", plot[:80], _PLOTS)
    draw: Any
    if plot == "precision_recall.svg":
        curve = report["precision_recall"]
        curves = {_title(found, report): (curve["recall"], curve["precision"])}
        draw = partial(pictures.precision_recall_plot, curves, theme=theme)
    elif plot == "confusion.svg":
        table = _mistakes(found, report)["confusion"]
        draw = partial(confusion_plot, np.array(table["counts"]), table["labels"], theme=theme)
    else:
        sha256 = evaluations.matrix_of(found)
        labels = [item["label"] for item in found.items or []]
        # D of a fused or re-ranked answer orders shapes; how far apart its values are means nothing.
        ranks = True if report.get("descriptor") == "fused" or report.get("rerank") else None

        def draw() -> bytes:
            merged, names = blocks(evaluations.matrix_rows(here.blobs, sha256), labels)
            return pictures.matrix_plot(merged, names, format="svg", theme=theme, ranks=ranks)

    return _svg(request, here, f"{found.id}-{plot}-{theme}", draw)


@router.get(
    "/plots/precision_recall.svg", operation_id="comparePrecisionRecall", summary="Several evaluations on one plot",
    response_class=Response, responses=_SVG,
)  # fmt: skip
def compare(
    request: Request, here: Here, principal: Reader,
    evaluation: Annotated[list[str], Query(description="Ids, one for each curve.", min_length=1, max_length=12)],
    theme: Theme = "light",
) -> Response:  # fmt: skip
    """Precision over recall of each evaluation that is named."""
    from reebase import pictures

    curves: dict[str, tuple[list[float], list[float]]] = {}
    found = [_found(here, principal, one) for one in dict.fromkeys(evaluation)]
    for number, (one, report) in enumerate(found, start=1):
        curve, title = report["precision_recall"], _title(one, report)
        name = f"{title} ({number})" if title in curves else title
        curves[name] = (curve["recall"], curve["precision"])
    name = "-".join(["precision", *(one.id for one, _ in found), theme])
    return _svg(request, here, name, lambda: pictures.precision_recall_plot(curves, theme=theme))


@router.get("/evaluations/{evaluation}/confusion", operation_id="getConfusion", summary="Confusion of classes")
def get_confusion(here: Here, principal: Reader, evaluation: IdPath) -> ConfusionValue:
    """How often the nearest shape to a query of each class is of each class."""
    return ConfusionValue(**_mistakes(*_found(here, principal, evaluation))["confusion"])


@router.get("/evaluations/{evaluation}/worst", operation_id="getWorstQueries", summary="Worst queries")
def get_worst(
    here: Here, principal: Reader, evaluation: IdPath,
    limit: Annotated[int, Query(ge=1, le=50, description="Queries.")] = 10,
) -> WorstValue:  # fmt: skip
    """The queries of the least average precision, each with its ten nearest shapes."""
    found, report = _found(here, principal, evaluation)
    items = found.items or []
    kept = found.collection_id is not None

    def about(row: int) -> dict[str, Any]:
        item = items[row]
        return {"shape": item["id"] if kept else None, "name": item["name"], "label": item["label"]}

    return WorstValue(items=[
        WorstQuery(
            **about(query["row"]), average_precision=query["average_precision"],
            hits=[RankedShape(**about(hit["row"]), relevant=hit["relevant"], dissimilarity=hit["dissimilarity"])
                  for hit in query["hits"]],
        )
        for query in _mistakes(found, report)["worst"][:limit]
    ])  # fmt: skip
