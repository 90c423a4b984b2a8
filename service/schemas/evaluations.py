"""Evaluations on the wire."""

from __future__ import annotations

from collections.abc import Collection
from typing import Annotated, Any

from pydantic import ConfigDict, Field, model_validator

from service.schemas.collections import ProfileBody
from service.schemas.common import Body, CollectionName, Finite, Moment, Text, Value, one_of
from service.schemas.tasks import TaskValue

__all__ = ["EvaluationValue", "MatrixValue", "NewEvaluation", "SyntheticBody"]


STORED_DESCRIPTORS = ("srg",)
"""Descriptors that are kept of every shape; an evaluation has no others to compare."""


def _measures() -> Collection[str]:
    from reebase.matching import MEASURES

    return MEASURES


def _classes() -> Collection[str]:
    from reebase.evaluation.synthetic import CLASSES

    return CLASSES


class SyntheticBody(Body):
    """The labelled synthetic set: ten articulated classes, the same for the same seed."""

    per_class: int = Field(25, ge=2, le=200)
    seed: int = Field(0, ge=0, le=2**63 - 1)
    noise: Annotated[Finite, Field(ge=0, le=5)] = Field(0.0, description="In mean edge lengths.")
    rotation: bool = True
    scale: bool = True
    tessellation: bool = True
    vertex_order: bool = True
    classes: list[Annotated[Text, one_of("class", _classes)]] | None = Field(
        None, min_length=2, max_length=10, description="Only these classes."
    )


class NewEvaluation(Body):
    """What to evaluate: a collection with labels, or the synthetic set."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"synthetic": {"per_class": 25, "seed": 0}, "measure": "matching"},
                {"collection": "animals"},
            ]
        }
    )

    collection: CollectionName | None = None
    synthetic: SyntheticBody | None = None
    profile: ProfileBody | None = Field(None, description="Of the synthetic set; a collection has its own.")
    measure: Annotated[Text, one_of("measure", _measures)] = "matching"
    descriptor: Annotated[Text, one_of("descriptor", lambda: STORED_DESCRIPTORS)] = "srg"
    bootstrap: int = Field(1000, ge=0, le=10_000, description="Resamples for the intervals.")

    @model_validator(mode="after")
    def _one_of_two(self) -> NewEvaluation:
        if (self.collection is None) == (self.synthetic is None):
            raise ValueError("give either collection or synthetic")
        if self.collection is not None and self.profile is not None:
            raise ValueError("a collection is evaluated with its own profile; leave profile out")
        return self


class EvaluationValue(Value):
    """An evaluation, its task, and the report once it succeeded."""

    id: str
    task: TaskValue
    request: dict[str, Any]
    report: dict[str, Any] | None = Field(
        description="overall, per_class, precision_recall and intervals; null until it succeeded, and in lists."
    )
    matrix: str | None = Field(description="Address of the dissimilarity matrix.")
    created_at: Moment


class MatrixValue(Value):
    """The dissimilarity matrix D; row i and column i belong to `items[i]`."""

    id: str
    items: list[dict[str, Any]]
    matrix: list[list[float]]
