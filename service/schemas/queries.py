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
    descriptor: Text | None = Field(
        None, description="What ranks: one of /v1/descriptors, which names the default. `srg` ranks by D(G, G̃)."
    )
    measure: Text | None = Field(None, description="How that is compared; by default its first measure.")
    rerank: bool | None = Field(
        None, description="Of `fused`: whether the ranking is refined by what the collection says; the default is yes."
    )
    tolerance: Annotated[int, Field(ge=0, le=10_000)] | None = Field(
        None, description="Endpoint counts may differ by so much; null for any. Left out: 2 for `srg`, else any."
    )
    label: Text | None = None
    tags: list[Text] = Field(default_factory=list, max_length=100, description="Shapes with all of these.")
    metadata: Metadata = Field(default_factory=dict)
    max_dissimilarity: Annotated[Finite, Field(ge=0)] | None = None


class QueryBody(QueryParameters):
    """A query by a shape of the same collection; the shape itself is not among the hits."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"shape": "0199b4c0-7d5e-7000-8000-2f6f3a9f0001", "k": 10},
                {"shape": "0199b4c0-7d5e-7000-8000-2f6f3a9f0001", "descriptor": "srg", "measure": "greedy"},
            ]
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
    descriptor: str
    measure: str | None = Field(description="Null for `fused`, which compares each part by its own first measure.")
    rerank: bool
    endpoint_count: int
    features: list[Triple]
    flags: list[str] = Field(
        default_factory=list,
        description="What is unusual about the query's mesh, as in the health report of a stored shape.",
    )
    positions: dict[str, list[Triple]] = Field(
        description="By descriptor: where the endpoints that it matches lie on the query's denoised mesh."
    )
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


class PartMatch(Value):
    """Which endpoints of a descriptor went together, by their places in its positions."""

    pairs: list[Pair]
    unmatched_query: list[Unmatched]
    unmatched_hit: list[Unmatched]
    note: str | None = Field(description="How the dissimilarity comes from what is listed, where it is not the sum.")
    positions: list[Triple] | None = Field(description="Of the hit's endpoints, on its denoised mesh.")


class Part(Value):
    """What one descriptor says of a hit, and how much of the similarity is its."""

    descriptor: str
    measure: str
    dissimilarity: float
    share: float = Field(description="The shares of a hit add up to 1.")
    matched: PartMatch | None = Field(description="Null for a descriptor that is one vector, and for `srg`, see pairs.")


class Hit(Value):
    """A ranked shape, what each part says of it, and D(G, G̃) with the matched endpoints that explain it."""

    rank: int
    shape: HitShape
    dissimilarity: float = Field(description="What ranks.")
    graph_dissimilarity: float = Field(description="D(G, G̃) of the two skeletons, whatever ranks.")
    endpoint_count: int
    parts: list[Part]
    pairs: list[Pair] = Field(description="Of D.")
    unmatched_query: list[Unmatched]
    unmatched_hit: list[Unmatched]
    note: str | None = Field(description="Where D is more than the sum of what is listed, how.")


class Bucket(Value):
    """How many shapes of one endpoint count were compared."""

    endpoint_count: int
    shapes: int


class LeftOut(Value):
    """Shapes that could not be compared, and why."""

    code: str = Field(examples=["without_descriptor"])
    shapes: int
    detail: str


class AnswerValue(Value):
    """Hits from most to least similar, ties by id."""

    query: QueryEcho
    hits: list[Hit]
    considered: int = Field(description="Shapes that were compared.")
    buckets: list[Bucket]
    left_out: list[LeftOut]
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
