"""Shapes on the wire, and what the pipeline learnt of them."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import ConfigDict, Field, model_validator

from service.schemas.common import Body, ErrorValue, Metadata, Moment, PageOf, Text, Triple, Value
from service.schemas.tasks import TaskValue

__all__ = [
    "Attributes", "FeaturesValue", "FieldValue", "HealthValue", "ShapePage", "ShapePatch", "ShapeValue",
    "SkeletonValue", "UploadValue",
]  # fmt: skip


class Attributes(Body):
    """What is said about a shape when it is uploaded."""

    name: Text | None = None
    label: Text | None = None
    tags: list[Text] = Field(default_factory=list)
    metadata: Metadata = Field(default_factory=dict)


class ShapePatch(Body):
    """What to change; `label` null takes the label away."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"label": "octopuses", "tags": ["scan", "clean"]}]}
    )

    name: Text | None = None
    label: Text | None = None
    tags: list[Text] | None = None
    metadata: Metadata | None = None

    @model_validator(mode="after")
    def _something(self) -> ShapePatch:
        if not self.model_fields_set:
            raise ValueError("give at least one of name, label, tags, metadata")
        for name in self.model_fields_set - {"label"}:
            if getattr(self, name) is None:
                raise ValueError(f"{name} must not be null")
        return self


class ShapeValue(Value):
    """A mesh in a collection."""

    id: str
    collection: str
    name: str
    label: str | None
    tags: list[str]
    metadata: dict[str, Any]
    state: str = Field(description="queued, running, indexed, failed or cancelled.")
    sha256: str = Field(description="Of the uploaded bytes.")
    bytes: int
    format: str
    filename: str | None
    endpoint_count: int | None = Field(description="Null until it was described.")
    flags: list[str] = Field(description="What is unusual; the health report explains each.")
    thumbnail: str | None = Field(description="Address of its picture, which may be kept for ever.")
    task: str | None = Field(description="Id of the task that the state follows.")
    error: ErrorValue | None = Field(description="Why it failed.")
    created_at: Moment
    updated_at: Moment


class ShapePage(PageOf[ShapeValue]):
    """A page of shapes, and how many the filters let pass."""

    total: int


class UploadValue(Value):
    """A shape, and the task that describes it."""

    shape: ShapeValue
    task: TaskValue | None


class Node(Value):
    """A node of the skeleton: a connected component of a band of the field."""

    position: Triple = Field(description="Area centroid, in the file's units.")
    area: float
    band: int


class Edge(Value):
    """Two nodes that share a stretch of level curve, by index; or, where `join`, that lie on either side of a gap."""

    nodes: Annotated[list[int], Field(min_length=2, max_length=2)]
    length: float
    join: bool = Field(description="Whether the edge leads across a gap between two parts of the surface.")


class Endpoint(Value):
    """A node of degree 1 and its feature vector ω = (a, dv, dc)."""

    node: int
    omega: Triple | None = Field(
        description="Relative area, relative sum of paths to the endpoints, relative path to the root."
    )


class Graph(Value):
    """A pruned spectral Reeb graph."""

    nodes: list[Node]
    edges: list[Edge]
    endpoints: list[Endpoint]
    root: int
    cycles: int


class PartSkeletonsValue(Value):
    """The skeleton of each part of the denoised mesh as if it were alone, the largest part first, 100 at most."""

    shape: str
    profile_key: str
    pipeline_version: int
    items: list[Graph]


class SkeletonValue(Graph):
    """The pruned spectral Reeb graph of the denoised mesh: of all its parts, joined, or of the largest alone."""

    shape: str | None = Field(description="Null for the mesh of a query.")
    profile_key: str
    pipeline_version: int
    eigenvalues: list[float] = Field(description="The first of the Laplace–Beltrami operator at unit area.")


class FieldValue(Value):
    """The scalar field at each vertex of the denoised mesh; null off the parts that the skeleton is of."""

    shape: str
    profile_key: str
    field: str = Field(examples=["fiedler"])
    values: list[float | None]


class FeaturesValue(Value):
    """The feature vectors ω = (a, dv, dc), one row an endpoint."""

    shape: str
    profile_key: str
    pipeline_version: int
    endpoint_count: int
    features: list[Triple]


class HealthValue(Value):
    """What was found in the mesh, what was repaired, what is unusual."""

    shape: str
    profile_key: str
    pipeline_version: int
    report: dict[str, Any]
    seconds: dict[str, float] = Field(description="Wall time of each stage.")
