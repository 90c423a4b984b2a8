"""What the service says about itself."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from service.schemas.common import Moment, Value

__all__ = [
    "DenoisingFilter", "FiltersValue", "Format", "FormatsValue", "LimitsValue", "LiveValue", "Measure", "MeasuresValue",
    "ReadyValue",
]  # fmt: skip


class LimitsValue(Value):
    """What a request may hold. Sizes are in bytes, times in seconds."""

    max_upload_bytes: int
    max_vertices: int
    max_faces: int
    max_json_bytes: int
    max_k: int
    max_batch: int
    max_batch_hits: int
    max_page: int
    max_wait_seconds: float
    max_name_length: int
    max_label_length: int
    max_tags: int
    max_tag_length: int
    max_metadata_bytes: int


class Format(Value):
    """A format that can be uploaded."""

    name: str = Field(examples=["ply"])
    media_type: str


class FormatsValue(Value):
    """All formats that can be uploaded, and those that meshes are given back in."""

    items: list[Format]
    written: list[str]


class Measure(Value):
    """A dissimilarity D."""

    name: str = Field(examples=["matching"])
    description: str


class MeasuresValue(Value):
    """All measures of D; `default` is used when a query names none."""

    items: list[Measure]
    default: str


class DenoisingFilter(Value):
    """A filter that a profile's `denoise` can name."""

    name: str = Field(examples=["finite_volume"])
    description: str


class FiltersValue(Value):
    """All denoising filters, and `none`; `default` is used when a profile names none."""

    items: list[DenoisingFilter]
    default: str


class NamedProfile(Value):
    """Parameters of the pipeline by name."""

    name: str = Field(examples=["thesis"])
    profile: dict[str, Any]


class ProfilesValue(Value):
    """What a profile's `base` can name; `default` is used where none is named."""

    items: list[NamedProfile]
    default: str


class LiveValue(Value):
    """The process answers."""

    status: str = Field(examples=["live"])
    version: str


class ReadyValue(Value):
    """The database is reachable and has the tables that this version needs."""

    status: str = Field(examples=["ready"])
    version: str
    worker: str = Field(
        description="`seen`, or `not seen yet`: what is uploaded waits until one starts.", examples=["seen"]
    )
    worker_seen_at: Moment | None = Field(description="When a worker last worked; null when none did yet.")
    queued: int
