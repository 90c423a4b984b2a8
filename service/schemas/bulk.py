"""Many shapes at once, on the wire."""

from __future__ import annotations

from typing import Annotated

from pydantic import ConfigDict, Field

from service.schemas.common import Body, Moment, Text, Value

__all__ = ["BulkLabel", "DeletedValue", "LabelCount", "LabelledValue", "LabelsValue", "Refusal", "RestoredValue",
           "ShapeIds"]  # fmt: skip

Ids = Annotated[
    list[Annotated[str, Field(max_length=80)]], Field(min_length=1, max_length=1000, description="Ids of shapes.")
]


class ShapeIds(Body):
    """Which shapes."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"shapes": ["0199b4c0-7d5e-7000-8000-2f6f3a9f0001"]}]})

    shapes: Ids


class BulkLabel(Body):
    """Which shapes get which label."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"shapes": ["0199b4c0-7d5e-7000-8000-2f6f3a9f0001"], "label": "ants"}]}
    )

    shapes: Ids
    label: Text | None = Field(description="Null takes the label away.")


class LabelledValue(Value):
    """How many of the shapes were there and have the label now."""

    labelled: int


class DeletedValue(Value):
    """Which of the shapes were there and are deleted now, and until when at least they can be restored."""

    deleted: list[str]
    restorable_until: Moment


class Refusal(Value):
    """Why one of several was refused."""

    shape: str
    code: str = Field(examples=["shape_exists"])
    detail: str


class RestoredValue(Value):
    """Which shapes are there again, and why others are not."""

    restored: list[str]
    refused: list[Refusal]


class LabelCount(Value):
    """A label and the number of its shapes."""

    label: str | None = Field(description="Null for the shapes without one.")
    shapes: int


class LabelsValue(Value):
    """The labels of a collection, that with most shapes first."""

    items: list[LabelCount]
