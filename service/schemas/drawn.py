"""What a page draws, on the wire."""

from __future__ import annotations

from pydantic import Field

from service.schemas.common import Value

__all__ = ["FieldInfo", "FieldsValue"]


class FieldInfo(Value):
    """A scalar on the vertices of a shape's meshes."""

    name: str = Field(examples=["displacement"])
    title: str
    description: str
    kind: str = Field(description="signed: zero lies in the middle; positive: at the beginning.")
    unit: str = Field(description="mesh: that of the file; empty for a field without a unit.")


class FieldsValue(Value):
    """The scalar fields of a shape."""

    items: list[FieldInfo]
