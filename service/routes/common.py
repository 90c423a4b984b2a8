"""What the routes share: paths, pages, and who may open which collection."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Header, Path, Query
from sqlalchemy import Connection

from service.auth import Principal
from service.checks import MAX_PAGE
from service.problems import PROBLEMS
from service.schemas.common import IDEMPOTENCY_KEY
from service.strict import StrictRoute
from store import collections
from store.records import Collection

__all__ = [
    "CollectionPath",
    "Cursor",
    "IdPath",
    "IdempotencyKey",
    "PageSize",
    "SkeletonOf",
    "api_router",
    "open_collection",
]

CollectionPath = Annotated[
    str, Path(alias="collection", description="Name of the collection.", examples=["animals"])
]
IdPath = Annotated[str, Path(examples=["0199b4c0-7d5e-7000-8000-2f6f3a9f0001"])]
SkeletonOf = Annotated[
    Literal["srg", "extended"], Query(description="The descriptor that matches the skeleton's endpoints.")
]
PageSize = Annotated[int, Query(alias="limit", ge=1, le=MAX_PAGE, description="Items on a page.")]
Cursor = Annotated[
    str | None,
    Query(alias="cursor", max_length=4000, description="`next` of the page before; none for the first."),
]
IdempotencyKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key", min_length=1, max_length=255, pattern=IDEMPOTENCY_KEY,
        description="The same key with the same request gives the first answer again, for a day.",
    ),
]  # fmt: skip


def api_router(tag: str) -> APIRouter:
    """A router under /v1 whose operations read JSON strictly and document their problems."""
    return APIRouter(prefix="/v1", tags=[tag], route_class=StrictRoute, responses=PROBLEMS)


def open_collection(conn: Connection, principal: Principal, name: str) -> Collection:
    """The collection. Raises ForbiddenScope for a key of another collection, CollectionNotFound."""
    principal.need_collection(name)
    return collections.get(conn, name)
