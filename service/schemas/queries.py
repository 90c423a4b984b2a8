"""Queries and answers on the wire."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import ConfigDict, Field

from service.problems import Problem
from service.schemas.common import Body, Finite, Metadata, Text, Triple, Value
from service.schemas.tasks import TaskValue

__all__ = ["AnswerValue", "BatchBody", "BatchValue", "PendingAnswer", "QueryBody", "QueryParameters"]


class QueryParameters(Body):
    """How to rank, and what to rank."""

    k: int = Field(10, ge=1, description="Number of hits; /v1/limits has the largest.")
    tolerance: Annotated[int, Field(ge=0, le=10_000)] | None = Field(
        2, description="Endpoint counts may differ by so much; null for any."
    )
    measure: Text = Field("matching", description="One of /v1/measures.")
    label: Text | None = None
    tags: list[Text] = Field(default_factory=list, max_length=100, description="Shapes with all of these.")
    metadata: Metadata = Field(default_factory=dict)
    max_dissimilarity: Annotated[Finite, Field(ge=0)] | None = None


class QueryBody(QueryParameters):
    """A query by a shape of the same collection; the shape itself is not among the hits."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"shape": "0199b4c0-7d5e-7000-8000-2f6f3a9f0001", "k": 10, "measure": "matching"}]
        }
    )

    shape: Text = Field(max_length=64, description="Id of the shape.")


class BatchBody(Body):
    """Several queries by shape; /v1/limits has the largest number, and the largest sum of their k."""

    queries: list[QueryBody] = Field(min_length=1)


class QueryEcho(Value):
    """The query as it was understood."""

    shape: str | None
    collection: str
    endpoint_count: int
    features: list[Triple]
    flags: list[str] = Field(
        default_factory=list,
        description="What is unusual about the query's mesh, as in the health report of a stored shape.",
    )
    measure: str
    k: int
    tolerance: int | None


class Pair(Value):
    """Two matched endpoints, by their rows in the features, and Φ, the distance of their ω."""

    query: int
    hit: int
    distance: float


class Unmatched(Value):
    """An endpoint without a partner, and what it adds to D."""

    endpoint: int
    charge: float


class HitShape(Value):
    """The shape of a hit."""

    id: str
    name: str
    label: str | None
    tags: list[str]
    metadata: dict[str, Any]
    filename: str | None
    format: str
    sha256: str


class Hit(Value):
    """A ranked shape: D(G, G̃), and the matched endpoints that explain it."""

    rank: int
    shape: HitShape
    dissimilarity: float
    endpoint_count: int
    pairs: list[Pair]
    unmatched_query: list[Unmatched]
    unmatched_hit: list[Unmatched]
    note: str | None = Field(description="Where D is more than the sum of what is listed, how.")


class Bucket(Value):
    """How many shapes of one endpoint count were compared."""

    endpoint_count: int
    shapes: int


class AnswerValue(Value):
    """Hits from most to least similar, ties by id."""

    query: QueryEcho
    hits: list[Hit]
    considered: int = Field(description="Shapes that were compared.")
    buckets: list[Bucket]
    took_ms: float


class PendingAnswer(Value):
    """The mesh is still being described; the task will hold the answer."""

    task: TaskValue


class BatchItem(Value):
    """The outcome of one query of a batch: an answer or a problem."""

    answer: AnswerValue | None
    problem: Problem | None


class BatchValue(Value):
    """Outcomes in the order of the queries."""

    results: list[BatchItem]
