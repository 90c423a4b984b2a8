"""Denoising on the wire."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from service.schemas.common import Body, Finite, Text, Value
from service.schemas.tasks import TaskValue

__all__ = ["DenoisedValue", "DenoisingParameters", "PendingDenoising"]


class DenoisingParameters(Body):
    """What is done to the mesh."""

    method: Text = Field("auto", description="One of /v1/filters, but `none`.")
    iterations: int = Field(1, ge=1, le=1000)
    boundary: Literal["curve", "fixed", "free"] = Field(
        "curve", description="Boundary vertices move along their curve, not at all, or as the filter says."
    )
    parameters: dict[str, bool | int | float | str] = Field(
        default_factory=dict, max_length=32, description="Of the method, by name."
    )
    wait: Finite = Field(30.0, ge=0, le=60, description="Seconds to wait for the result.")


class PartValue(Value):
    """A filter, and its share of the mean of displacements."""

    share: float
    method: str
    iterations: int
    parameters: dict[str, Any]


class ChoiceValue(Value):
    """What `auto` picked, and why."""

    parts: list[PartValue] = Field(description="The largest share first; none where the mesh stays.")
    noise: float = Field(description="Its standard deviation along normals, in mean edge lengths.")
    surface: str = Field(description="sharp, smooth, scan or clean.")
    reason: str


class ErrorsValue(Value):
    """How far a mesh is from the truth."""

    mean_angle: float = Field(description="Between face normals, degrees.")
    edge_angle: float | None = Field(
        description="The same within one ring of edges above 60 degrees; null without such."
    )
    face_normal_error: float = Field(description="L2, in [0, 2].")
    visual_error: float = Field(description="In squared mean edge lengths of the truth.")
    displacement: float = Field(description="Mean distance of vertices, in mean edge lengths of the truth.")
    vertex_error: float = Field(description="Mean distance to the true surface over its diagonal.")
    volume_change: float | None = Field(description="Percent; null where the faces enclose no volume.")


class BothErrors(Value):
    """Errors of the mesh that came, and of the result."""

    before: ErrorsValue
    after: ErrorsValue


class Ways(Value):
    """How far vertices moved, in the mesh's own units."""

    mean: float
    largest: float


class DenoisedValue(Value):
    """What was done to a mesh."""

    task: str = Field(description="Id of the task; its result is kept for some days.")
    mesh: str = Field(description="Where the mesh is: ?format=ply, glb, obj, stl or off.")
    method: str
    iterations: int = Field(description="How often the method ran; 0 where `auto` left the mesh as it is.")
    boundary: str
    parameters: dict[str, Any]
    choice: ChoiceValue | None = Field(description="Of `auto`; null for other methods.")
    vertices: int
    faces: int
    mean_edge_length: float
    displacement: Ways
    errors: BothErrors | None = Field(description="Where a truth came with the mesh.")


class PendingDenoising(Value):
    """The mesh is still being denoised."""

    task: TaskValue
