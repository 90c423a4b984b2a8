"""Near-duplicates on the wire."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from service.schemas.common import Moment, Value
from service.schemas.tasks import TaskValue

__all__ = ["DuplicatesValue", "FindingValue", "FoundShape"]


class FoundShape(Value):
    """One of the two."""

    id: str
    name: str
    label: str | None


class FindingValue(Value):
    """Two shapes that are one, what was done to one of them, and the numbers that say so."""

    first: FoundShape
    second: FoundShape = Field(description="The first again, where one file holds several copies.")
    classes: list[str] = Field(
        description="same_mesh, noisy, decimated or remeshed; and moved, rescaled, mirrored, copies.",
        examples=[["same_mesh", "rescaled"]],
    )
    confidence: str = Field(description="certain, strong or fair.")
    scale: float = Field(description="What the first must be multiplied by to have the second's size.")
    units: str | None = Field(description="Which units were taken for one another, where the scale says so.")
    copies: int = Field(description="Counted up to 100; the words say when there may be more.")
    words: str
    evidence: dict[str, Any] | None = Field(
        description="residual and farthest (in mean edge lengths), same_faces (share), vertices, area and volume "
        "(of the first over the second), mirrored, and the motion that lays one on the other."
    )


class DuplicatesValue(Value):
    """What was found, the strongest first. Nothing is ever deleted because of it."""

    state: str = Field(description="current; outdated: shapes came or went since; none: it was not sought yet.")
    task: TaskValue | None = Field(description="The task that is seeking, or why the last one did not succeed.")
    made_at: Moment | None
    compared: int
    left_out: int = Field(description="Described shapes without what they are sought by; reindex gives it to them.")
    pairs: int = Field(description="Pairs that were compared.")
    pairs_left_out: int = Field(
        description="Candidates that were not compared: those farthest apart of more than 20,000."
    )
    total: int = Field(
        description="Findings that the filters let pass, with those beyond the strongest 2,000, which are only counted."
    )
    findings: list[FindingValue]
