"""The map of a collection, on the wire."""

from __future__ import annotations

from typing import Annotated

from pydantic import ConfigDict, Field

from service.schemas.common import Body, Moment, Text, Value, one_of
from service.schemas.tasks import TaskValue

__all__ = ["MapBody", "MapPoint", "MapValue", "rankings"]


def rankings() -> tuple[str, ...]:
    from reebase.ranking import RANKINGS

    return RANKINGS


class MapBody(Body):
    """By what to map."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"descriptor": "extended"}]})

    descriptor: Annotated[Text, one_of("descriptor", rankings)] | None = Field(
        None, description="Null: the default of queries, or srg where shapes lack a part of it."
    )


class MapPoint(Value):
    """A shape and its place, both coordinates in [-1, 1]."""

    shape: str
    name: str
    label: str | None
    x: float
    y: float


class MapValue(Value):
    """Shapes in the plane, neighbours beside neighbours."""

    state: str = Field(description="current; outdated: shapes came or went since; none: it was not made yet.")
    descriptor: str
    task: TaskValue | None = Field(description="The task that is making it, or why the last one did not succeed.")
    made_at: Moment | None
    left_out: int = Field(
        description="Shapes that are not on it: it holds 1500 at most, of those that have the descriptor."
    )
    neighbours_kept: float | None = Field(
        description="Which share of the ten nearest shapes of each is among its ten nearest points."
    )
    points: list[MapPoint]
