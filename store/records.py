"""What the store's functions return: frozen values with aware UTC datetimes, never rows."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Generic, Literal, TypeVar

import numpy as np
import numpy.typing as npt

from reebase.mesh.health import Health
from reebase.skeleton.graph import Skeleton

__all__ = [
    "ApiKey", "Collection", "Counts", "Evaluation", "Filters", "Page", "Shape", "ShapeState",
    "StoredFeatures", "StoredHealth", "StoredSkeleton", "Task", "TaskKind", "TaskState",
]  # fmt: skip

TaskKind = Literal["describe", "query", "evaluate", "denoise", "duplicates", "map", "synthesise", "report"]
TaskState = Literal["queued", "running", "succeeded", "failed", "cancelled"]
ShapeState = Literal["queued", "running", "indexed", "failed", "cancelled"]
Scope = Literal["read", "write", "admin"]

T = TypeVar("T")


@dataclass(frozen=True)
class Page(Generic[T]):
    """Some of a list; ``next`` is the cursor of the page that follows, None at the end."""

    items: tuple[T, ...]
    next: str | None


@dataclass(frozen=True)
class Collection:
    """A named set of shapes that are described with the same profile."""

    id: str
    name: str
    description: str
    profile: dict[str, Any]
    profile_key: str
    created_at: datetime
    updated_at: datetime


@dataclass(frozen=True)
class Counts:
    """How many shapes a collection has: by state, and by endpoint count under its present profile."""

    by_state: dict[str, int]
    by_endpoint_count: dict[int, int]

    @property
    def shapes(self) -> int:
        return sum(self.by_state.values())


@dataclass(frozen=True)
class Shape:
    """A mesh in a collection.

    sha256, bytes: of the upload. task_id: the task that ``state`` follows. deleted_at: None while it is there.
    endpoint_count, flags, thumbnail_sha256: of its latest description; None, () and None before there is one.
    """

    id: str
    collection_id: str
    sha256: str
    bytes: int
    format: str
    filename: str | None
    name: str
    label: str | None
    tags: tuple[str, ...]
    metadata: dict[str, Any]
    state: ShapeState
    task_id: str | None
    owner: str | None
    created_at: datetime
    updated_at: datetime
    deleted_at: datetime | None
    endpoint_count: int | None
    flags: tuple[str, ...]
    thumbnail_sha256: str | None


@dataclass(frozen=True)
class Filters:
    """Which shapes: all that is given must hold.

    tags: the shape has every one of them. metadata: top-level keys with exactly these JSON values.
    text: stands in its name, file name or label, whatever the case of its letters. unlabelled: has no label.
    """

    label: str | None = None
    tags: tuple[str, ...] = ()
    state: str | None = None
    sha256: str | None = None
    metadata: dict[str, Any] = field(default_factory=dict)
    text: str | None = None
    unlabelled: bool = False

    def __bool__(self) -> bool:
        return self != Filters()


@dataclass(frozen=True)
class Task:
    """A piece of background work.

    attempt: the fencing token of the claim. crashes: times its worker died, apart from errors.
    error_detail: ``{"message": ..., ...}`` when it failed. fraction: of the whole, in [0, 1].
    """

    id: str
    kind: TaskKind
    state: TaskState
    collection_id: str | None
    shape_id: str | None
    params: dict[str, Any]
    blob: str | None
    result: dict[str, Any] | None
    error_code: str | None
    error_detail: dict[str, Any] | None
    stage: str | None
    fraction: float
    attempt: int
    crashes: int
    cancel_requested: bool
    worker: str | None
    lease_until: datetime | None
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None

    @property
    def ended(self) -> bool:
        return self.state in ("succeeded", "failed", "cancelled")


@dataclass(frozen=True, eq=False)
class StoredFeatures:
    """omega of each endpoint, float64, (endpoint_count, 3), in the order of the skeleton's endpoints."""

    shape_id: str
    profile_key: str
    pipeline_version: int
    endpoint_count: int
    features: npt.NDArray[np.float64]
    revision: int


@dataclass(frozen=True, eq=False)
class StoredSkeleton:
    """The pruned skeleton, the first eigenvalues at unit area, and the blobs of the two meshes (PLY).

    display_sha256, thumbnail_sha256: the blobs that a page draws, None in descriptions of before they were made.
    limbs: the skeleton whose endpoints ``extended`` matches; None where that is not kept.
    """

    shape_id: str
    profile_key: str
    pipeline_version: int
    skeleton: Skeleton
    eigenvalues: npt.NDArray[np.float64]
    cleaned_sha256: str
    denoised_sha256: str
    display_sha256: str | None
    thumbnail_sha256: str | None
    limbs: Skeleton | None


@dataclass(frozen=True)
class StoredHealth:
    """The health report, and how long each stage took in seconds."""

    shape_id: str
    profile_key: str
    pipeline_version: int
    report: Health
    seconds: dict[str, float]


@dataclass(frozen=True)
class Evaluation:
    """An evaluation and its task; ``report`` and ``items`` are None until it succeeded, and in lists.

    items: the rows of the matrix in order, each ``{"id", "name", "label"}``.
    """

    id: str
    task: Task
    collection_id: str | None
    params: dict[str, Any]
    report: dict[str, Any] | None
    items: list[dict[str, Any]] | None
    matrix_sha256: str | None
    created_at: datetime


@dataclass(frozen=True)
class ApiKey:
    """An API key without its secret. collection: the name of the one collection it opens, None for all."""

    id: str
    name: str
    prefix: str
    scope: Scope
    collection_id: str | None
    collection: str | None
    requests_per_minute: int | None
    max_shapes: int | None
    created_at: datetime
    last_used_at: datetime | None
    revoked_at: datetime | None
