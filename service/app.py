"""The application: ``create_app(settings)`` puts the layers and the routes together.

A request passes, from the outside in: HEAD becomes GET, ``edge`` (id, log, metrics, last resort), lingering
close, ``guards`` (host, origin, encoding), ``auth`` (who asks), ``conditional`` (ETag), and then a route.
"""

from __future__ import annotations

import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from typing import Any

import structlog
from fastapi import APIRouter, FastAPI
from fastapi.routing import APIRoute
from starlette.routing import Match

import reebase
from service import problems
from service.auth import Authentication
from service.conditional import ConditionalReads
from service.context import Context
from service.edge import Edge, Heads, Linger
from service.guards import Guards
from service.metrics import Metrics
from service.routes import (
    about,
    bulk,
    collections,
    denoise,
    drawn,
    duplicates,
    evaluations,
    events,
    maps,
    operations,
    pages,
    plots,
    queries,
    rankings,
    reports,
    results,
    shapes,
    synthetic,
    tasks,
)
from service.settings import ServiceSettings

__all__ = ["create_app"]

DESCRIPTION = (
    "Which shapes are like this one, and why? Meshes go in; a worker checks, denoises and skeletonises them; "
    "a query returns ranked shapes with D(G, G̃) and the matched endpoints. Lists are cursor pages, long work "
    "is a task, every error is application/problem+json with a stable code, times are UTC."
)

_ROUTERS: tuple[APIRouter, ...] = (
    collections.router, shapes.router, bulk.router, maps.router, synthetic.router, results.router, drawn.router,
    duplicates.router, queries.router, rankings.router, denoise.router, tasks.router, events.router,
    evaluations.router, plots.router, reports.router, about.router, operations.router, pages.router,
)  # fmt: skip


def create_app(settings: ServiceSettings | None = None) -> FastAPI:
    """The service. Its database must have been migrated; it is opened when the server starts."""
    settings = settings or ServiceSettings()
    metrics = Metrics()
    app = FastAPI(
        title="Reebase", version=reebase.__version__, description=DESCRIPTION, docs_url=None, redoc_url=None,
        license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"}, redirect_slashes=False,
        lifespan=_lifespan(settings, metrics), separate_input_output_schemas=False,
    )  # fmt: skip
    app.state.stopping = threading.Event()
    app.state.allowed_methods = allowed_methods
    app.state.lost_page = pages.lost_page
    problems.install(app)
    for router in _ROUTERS:
        app.include_router(router)
    # The last one added is the outermost.
    app.add_middleware(ConditionalReads)
    app.add_middleware(Authentication)
    app.add_middleware(Guards, hosts=settings.known_hosts)
    app.add_middleware(Linger)
    app.add_middleware(Edge, metrics=metrics)
    app.add_middleware(Heads)
    _describe(app)
    return app


def _lifespan(settings: ServiceSettings, metrics: Metrics) -> Callable[[FastAPI], Any]:
    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        context = Context.open(settings, metrics, app.state.stopping)
        app.state.context = context
        # Compiled kernels load in a third of a second, a large collection in seconds: not in the first query.
        threading.Thread(target=_warm, args=(context,), name="warm", daemon=True).start()
        try:
            yield
        finally:
            context.stopping.set()
            context.close()

    return lifespan


def _warm(context: Context) -> None:
    import numpy as np

    from reebase.matching import MEASURES, match
    from reebase.ranking import ranking_named
    from reebase.search import Index

    try:
        index, features = Index(), np.array([[0.5, 0.5, 0.5], [0.25, 0.5, 0.5]])
        index.add("warm", features)
        for measure in MEASURES:
            index.query(features, measure=measure)
            match(features, features, measure)
        context.follower.read_ahead(ranking_named(), context.stopping)
    except Exception:
        if not context.stopping.is_set():
            structlog.get_logger("service").exception("warming_failed")


def _routes() -> Iterator[APIRoute]:
    for router in _ROUTERS:
        for route in router.routes:
            if isinstance(route, APIRoute):
                yield route


def allowed_methods(path: str) -> list[str]:
    """The methods that any route takes at this path."""
    scope = {"type": "http", "path": path, "method": "GET", "headers": [], "root_path": ""}
    found: set[str] = set()
    for route in _routes():
        if route.matches(scope)[0] is not Match.NONE:
            found |= route.methods or set()
    return sorted(found)


def _describe(app: FastAPI) -> None:
    """Add to the OpenAPI document what FastAPI cannot know: keys, and one schema of problems everywhere."""
    made = app.openapi

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            document = made()
            document["components"]["securitySchemes"] = {
                "key": {
                    "type": "http", "scheme": "bearer",
                    "description": "`Authorization: Bearer rb_…`; on loopback none is needed by default.",
                }
            }  # fmt: skip
            document["security"] = [{"key": []}, {}]
            for operation in (op for path in document["paths"].values() for op in path.values()):
                for status, answer in operation["responses"].items():
                    if status >= "4":
                        schema = {"$ref": "#/components/schemas/Problem"}
                        answer["content"] = {problems.MEDIA_TYPE: {"schema": schema}}
            for unused in ("HTTPValidationError", "ValidationError"):
                document["components"]["schemas"].pop(unused, None)
        return app.openapi_schema or document

    app.openapi = openapi  # type: ignore[method-assign]
