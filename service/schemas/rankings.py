"""What can rank, on the wire."""

from __future__ import annotations

from collections.abc import Collection
from typing import Annotated

from pydantic import Field

from service.schemas.common import Body, Text, Value, one_of

__all__ = [
    "CoverageValue", "DescriptorCoverage", "DescriptorValue", "DescriptorsValue", "ReindexBody", "ReindexValue",
]  # fmt: skip


class DescriptorValue(Value):
    """Something that ranks: a descriptor, or `fused`, which is several."""

    name: str = Field(examples=["extended"])
    description: str
    measures: list[str] = Field(description="How it can be compared, the default first; empty for `fused`.")
    explained: bool = Field(description="Whether hits say which endpoints went together.")
    rerank: bool = Field(description="Whether `rerank` goes with it.")
    parts: list[str] = Field(description="The descriptors that it compares.")
    kept: bool = Field(description="Whether this service keeps what it compares of every shape.")


class DescriptorsValue(Value):
    """All that `descriptor` may be; `default` ranks a query that names none."""

    items: list[DescriptorValue]
    default: str


class DescriptorCoverage(Value):
    """Of how many shapes a descriptor is kept."""

    name: str
    kept: bool = Field(description="Whether shapes that are described now get it.")
    shapes: int = Field(description="Shapes that have it and can be ranked by it.")
    lacking: int = Field(description="Described shapes that lack it.")


class CoverageValue(Value):
    """What the described shapes of a collection can be ranked by."""

    described: int = Field(description="Shapes that are described under the present profile.")
    items: list[DescriptorCoverage]


def _descriptors() -> Collection[str]:
    from reebase.descriptors import DESCRIPTORS

    return DESCRIPTORS


class ReindexBody(Body):
    """What shapes should get beside what this service keeps."""

    descriptors: list[Annotated[Text, one_of("descriptor", _descriptors)]] = Field(
        default_factory=list, max_length=100, examples=[["patches"]]
    )


class ReindexValue(Value):
    """How many shapes were queued to be described again."""

    queued: int
