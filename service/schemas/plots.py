"""What an evaluation got wrong, on the wire."""

from __future__ import annotations

from pydantic import Field

from service.schemas.common import Value

__all__ = ["ConfusionValue", "RankedShape", "WorstQuery", "WorstValue"]


class ConfusionValue(Value):
    """How often the nearest shape to a query of each class is of each class."""

    labels: list[str]
    counts: list[list[int]] = Field(description="Row: class of the query. Column: class of its nearest shape.")


class RankedShape(Value):
    """A shape that was retrieved."""

    shape: str | None = Field(description="Its id; null where shapes were made for the evaluation alone.")
    name: str
    label: str
    relevant: bool = Field(description="Whether it is of the query's class.")
    dissimilarity: float


class WorstQuery(Value):
    """A query and what it retrieved first."""

    shape: str | None
    name: str
    label: str
    average_precision: float
    hits: list[RankedShape]


class WorstValue(Value):
    """The queries of the least average precision, worst first."""

    items: list[WorstQuery]
