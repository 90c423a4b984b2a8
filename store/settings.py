"""Settings that the service, the worker and the commands share, read from the environment.

Every field is an environment variable: ``lease_seconds`` is ``REEBASE_LEASE_SECONDS``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, field_validator, model_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from reebase.descriptors import DESCRIPTORS
from reebase.ranking import PARTS
from store.engine import sqlite_url

__all__ = ["Settings"]

_CHECKOUT = Path(__file__).resolve().parent.parent
_KIB, _MIB, _GIB = 2**10, 2**20, 2**30


class Settings(BaseSettings):
    """Where things are kept and how much is allowed. Sizes are in bytes, times in seconds."""

    model_config = SettingsConfigDict(env_prefix="REEBASE_", frozen=True, extra="ignore")

    # Where. An empty database_url or blobs means the embedded default under ``home``.
    home: Path = _CHECKOUT / "var"
    database_url: str = ""
    blobs: str = ""

    # What a caller may send; listed at /v1/limits.
    max_upload_bytes: int = Field(256 * _MIB, ge=1)
    max_vertices: int = Field(1_000_000, ge=3)
    max_faces: int = Field(2_000_000, ge=1)
    max_k: int = Field(1000, ge=1)
    max_label_length: int = Field(200, ge=1)
    max_name_length: int = Field(200, ge=1)
    max_tags: int = Field(32, ge=0)
    max_tag_length: int = Field(64, ge=1)
    max_metadata_bytes: int = Field(16 * _KIB, ge=2)
    max_batch: int = Field(100, ge=1)
    max_batch_hits: int = Field(5000, ge=1)

    # What is kept of every shape beside the endpoint features, separated by commas: it can be ranked by that. By
    # default what `fused` compares and what costs little beside it; a collection gets others by reindexing.
    descriptors: Annotated[tuple[str, ...], NoDecode] = tuple(
        name for name in DESCRIPTORS if name in (*PARTS, "shape_dna", "hks", "d2")
    )
    # What one process holds of these in memory, for queries; beyond it the collections asked for longest ago go.
    gallery_memory_bytes: int = Field(1 * _GIB, ge=_MIB)

    # Tasks.
    lease_seconds: float = Field(30.0, gt=0)
    max_crashes: int = Field(3, ge=1)

    # The child process that handles one mesh.
    child_memory_bytes: int = Field(4 * _GIB, ge=128 * _MIB)
    child_cpu_seconds: int = Field(300, ge=1)
    child_wall_seconds: float = Field(600.0, gt=0)
    child_file_bytes: int = Field(1 * _GIB, ge=1)

    # The sweep. Blobs younger than the grace may belong to an upload whose row is not committed yet.
    sweep_grace_seconds: float = Field(3600.0, ge=0)
    # How long a deleted shape can be restored.
    keep_deleted_seconds: float = Field(86400.0, ge=0)
    keep_query_seconds: float = Field(7 * 86400.0, ge=0)
    keep_tombstones_seconds: float = Field(7 * 86400.0, ge=0)

    @field_validator("descriptors", mode="before")
    @classmethod
    def _descriptors(cls, given: str | tuple[str, ...]) -> tuple[str, ...]:
        names = given.split(",") if isinstance(given, str) else given
        chosen = {name.strip() for name in names} - {"", "srg"}
        if unknown := sorted(chosen - set(DESCRIPTORS)):
            raise ValueError(f"there is no descriptor {', '.join(unknown)}; there are {', '.join(DESCRIPTORS)}")
        return tuple(name for name in DESCRIPTORS if name in chosen)

    @model_validator(mode="after")
    def _places(self) -> Self:
        home = self.home.expanduser().absolute()
        places = {
            "home": home,
            "database_url": self.database_url or sqlite_url(home / "reebase.sqlite"),
            "blobs": self.blobs or str(home / "blobs"),
        }
        for name, value in places.items():
            object.__setattr__(self, name, value)
        return self
