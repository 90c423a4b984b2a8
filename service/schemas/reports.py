"""Reports on the wire."""

from __future__ import annotations

from typing import Annotated

from pydantic import ConfigDict, Field

from service.schemas.common import Body, Text

__all__ = ["NewReport"]


class NewReport(Body):
    """Which evaluations to put side by side."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"evaluations": ["0199b4c0-7d5e-7000-8000-2f6f3a9f0001"], "title": "animals"}]}
    )

    evaluations: list[Annotated[str, Field(max_length=80)]] = Field(
        min_length=1, max_length=16, description="Ids, all of the same shapes."
    )
    title: Text | None = Field(None, max_length=200, description="By default the name of the collection.")
