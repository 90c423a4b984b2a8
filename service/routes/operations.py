"""For operators: is the process alive, can it serve, what does it do."""

from __future__ import annotations

from functools import partial
from typing import Any

from anyio import to_thread
from fastapi import APIRouter
from sqlalchemy.exc import SQLAlchemyError
from starlette.requests import Request
from starlette.responses import Response

import reebase
from reebase.words import program
from service import metrics
from service.auth import Reader
from service.context import Context, Here
from service.errors import NotReady
from service.problems import PROBLEMS
from service.schemas.about import LiveValue, ReadyValue
from store import migrate
from store.errors import StoreError

__all__ = ["router"]

router = APIRouter(tags=["operations"])

_PROBE_PROBLEMS: dict[int | str, dict[str, Any]] = {status: PROBLEMS[status] for status in (421, 500, 503)}


_METRICS: dict[int | str, dict[str, Any]] = {
    **{status: PROBLEMS[status] for status in (401, 403, 421, 429, 500, 503)},
    200: {
        "description": "Text exposition format.",
        "content": {"text/plain": {"schema": {"type": "string"}}},
    },
}


@router.get("/livez", operation_id="getLiveness", summary="Is the process alive?", responses=_PROBE_PROBLEMS)
async def livez() -> LiveValue:
    """Answers as long as the process does."""
    return LiveValue(status="live", version=reebase.__version__)


@router.get("/readyz", operation_id="getReadiness", summary="Can it serve?", responses=_PROBE_PROBLEMS)
async def readyz(here: Here) -> ReadyValue:
    """Whether the database answers and has this version's tables; a worker may be missing.

    What it says of tasks and workers is at most five seconds old.
    """
    # A thread of its own: long queries that hold all others must not make the service look dead.
    return await to_thread.run_sync(partial(_readiness, here), limiter=here.probes)


def _readiness(here: Context) -> ReadyValue:
    if here.stopping.is_set():
        raise NotReady("The service is stopping.")
    try:
        with here.database.read() as conn:
            if not migrate.is_current(conn):
                raise NotReady(
                    f"The database does not have the tables of this version; run `{program()} migrate`."
                )
            found = here.overview.read(conn)
    except (SQLAlchemyError, StoreError) as error:
        raise NotReady(f"The database does not answer: {type(error).__name__}.") from error
    queued = sum(count for (_, state), count in found.counts.items() if state == "queued")
    return ReadyValue(
        status="ready", version=reebase.__version__, worker="not seen yet" if found.worker_seen is None else "seen",
        worker_seen_at=found.worker_seen, queued=queued,
    )  # fmt: skip


@router.get(
    "/metrics", operation_id="getMetrics", summary="Prometheus metrics", response_class=Response,
    responses=_METRICS,
)  # fmt: skip
def show_metrics(request: Request, here: Here, _: Reader) -> Response:
    """Requests by route, and tasks by kind and state as they were at most five seconds ago."""
    with here.database.read() as conn:
        counts = here.overview.read(conn).counts
    return Response(here.metrics.render(counts), headers={"Content-Type": metrics.MEDIA_TYPE})
