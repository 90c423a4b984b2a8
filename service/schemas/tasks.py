"""Tasks on the wire."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from service.schemas.common import ErrorValue, Moment, Progress, Value

__all__ = ["TaskValue"]


class TaskValue(Value):
    """A piece of background work."""

    id: str
    kind: str = Field(description="describe, query, evaluate, denoise, duplicates, map, synthesise or report.")
    state: str = Field(description="queued, running, succeeded, failed or cancelled.")
    progress: Progress
    collection: str | None = Field(description="Name of its collection; null when it has none or it is gone.")
    shape: str | None = Field(description="Id of the shape that it describes.")
    shape_name: str | None = Field(None, description="Its name; null when it has none or is gone.")
    error: ErrorValue | None
    result: dict[str, Any] | None = Field(description="What it answers, where that is read nowhere else; not in lists.")
    attempt: int
    crashes: int = Field(description="Times that its worker died.")
    cancel_requested: bool
    created_at: Moment
    started_at: Moment | None
    finished_at: Moment | None
