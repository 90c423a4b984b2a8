"""Evaluations on the wire."""

from __future__ import annotations

from collections.abc import Collection
from typing import Annotated, Any

from pydantic import ConfigDict, Field, ValidationInfo, field_validator, model_validator

from reebase.errors import ParameterError
from service.schemas.collections import ProfileBody
from service.schemas.common import Body, CollectionName, Finite, Moment, Text, Value, one_of, refused
from service.schemas.tasks import TaskValue

__all__ = ["EvaluationValue", "MatrixValue", "NewEvaluation", "SyntheticBody"]


def _rankings() -> Collection[str]:
    from reebase.ranking import RANKINGS

    return RANKINGS


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
                {"synthetic": {"per_class": 25, "seed": 0}, "descriptor": "srg", "measure": "matching"},
                {"collection": "animals", "descriptor": "fused"},
            ]
        }
    )

    collection: CollectionName | None = None
    synthetic: SyntheticBody | None = None
    profile: ProfileBody | None = Field(None, description="Of the synthetic set; a collection has its own.")
    descriptor: Annotated[Text, one_of("descriptor", _rankings)] | None = Field(
        None, description="What ranks: one of /v1/descriptors. Null: the default of queries, or srg with a measure."
    )
    measure: Annotated[Text, Field(max_length=64)] | None = Field(
        None, description="How that is compared; by default its first measure."
    )
    rerank: bool | None = Field(None, description="Of `fused`: whether it is re-ranked; the default is yes.")
    bootstrap: int = Field(1000, ge=0, le=10_000, description="Resamples for the intervals.")

    @field_validator("measure", "rerank")
    @classmethod
    def _goes_with_the_descriptor(cls, value: Any, info: ValidationInfo) -> Any:
        from reebase.ranking import ranking_named

        if "descriptor" in info.data:
            try:
                ranking_named(info.data["descriptor"], **{str(info.field_name): value})
            except ParameterError as error:
                raise refused(error) from None
        return value

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
