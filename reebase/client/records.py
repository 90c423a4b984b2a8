"""What the service sends, as values. Members that this version does not know are passed over."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = [
    "Answer", "Choice", "Collection", "Counts", "Coverage", "Denoised", "DenoisingPart", "Descriptor", "Duplicate",
    "Duplicates", "Errors", "Evaluation", "Failure", "Filter", "Formats", "Hit", "HitShape", "Matrix", "Measure",
    "Pair", "Part", "PartMatch", "Progress", "Readiness", "ServiceLimits", "Shape", "Task", "Unmatched", "Upload",
]  # fmt: skip



@dataclass(frozen=True)
class Counts:
    """shapes: in all; states: by state; endpoints: indexed shapes by endpoint count."""

    shapes: int
    states: dict[str, int]
    endpoints: dict[int, int]


@dataclass(frozen=True)
class Collection:
    """A named set of shapes that went through one profile of the pipeline."""

    name: str
    description: str
    profile: dict[str, Any]
    profile_key: str
    counts: Counts
    created_at: datetime
    updated_at: datetime


@dataclass(frozen=True)
class Failure:
    """Why a task failed: a stable code, words, and what a program may want."""

    code: str
    detail: str
    details: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Progress:
    """The stage that runs, and the fraction of the whole that is done, 0 to 1."""

    stage: str | None
    fraction: float


@dataclass(frozen=True)
class Shape:
    """A mesh in a collection.

    state: queued, running, indexed, failed or cancelled; error: why it failed; task: the id of the task that the
    state follows. sha256, bytes: of the upload. endpoint_count: None until it is described. flags: what is
    unusual, explained in the health report.
    """

    id: str
    collection: str
    name: str
    label: str | None
    tags: tuple[str, ...]
    metadata: dict[str, Any]
    state: str
    sha256: str
    bytes: int
    format: str
    filename: str | None
    endpoint_count: int | None
    flags: tuple[str, ...]
    task: str | None
    error: Failure | None
    created_at: datetime
    updated_at: datetime

    @property
    def settled(self) -> bool:
        """Whether it is neither waiting nor being described."""
        return self.state in ("indexed", "failed", "cancelled")


@dataclass(frozen=True)
class Task:
    """Work in the background. state: queued, running, succeeded, failed or cancelled.

    kind: describe, query or evaluate. result: of a query by mesh, the answer as JSON.
    """

    id: str
    kind: str
    state: str
    progress: Progress
    collection: str | None
    shape: str | None
    error: Failure | None
    result: dict[str, Any] | None
    attempt: int
    crashes: int
    cancel_requested: bool
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None

    @property
    def ended(self) -> bool:
        return self.state in ("succeeded", "failed", "cancelled")


@dataclass(frozen=True)
class Upload:
    """What an upload led to. task: what describes the shape; created: False when these bytes were there already."""

    shape: Shape
    task: Task | None
    created: bool


@dataclass(frozen=True)
class Pair:
    """A matched pair of endpoints, by their rows in the two feature arrays, and Phi, their distance."""

    query: int
    hit: int
    distance: float


@dataclass(frozen=True)
class Unmatched:
    """An endpoint without a partner, and what it adds to D."""

    endpoint: int
    charge: float


@dataclass(frozen=True)
class HitShape:
    """The shape of a hit."""

    id: str
    name: str
    label: str | None
    tags: tuple[str, ...]
    metadata: dict[str, Any]
    filename: str | None
    format: str
    sha256: str


@dataclass(frozen=True)
class PartMatch:
    """Which endpoints of a descriptor went together, by their places in its positions.

    note: how the dissimilarity comes from what is listed, where it is not the sum. positions: of the hit's endpoints,
    on its denoised mesh, where the descriptor says where they lie.
    """

    pairs: tuple[Pair, ...]
    unmatched_query: tuple[Unmatched, ...]
    unmatched_hit: tuple[Unmatched, ...]
    positions: tuple[tuple[float, float, float], ...] | None
    note: str | None = None


@dataclass(frozen=True)
class Part:
    """What one descriptor says of a hit. share: of the similarity, of all parts together 1. matched: None for a
    descriptor that is one vector, and for ``srg``, of which the hit itself says it.
    """

    descriptor: str
    measure: str
    dissimilarity: float
    share: float
    matched: PartMatch | None


@dataclass(frozen=True)
class Hit:
    """A ranked shape. dissimilarity: what ranks. parts: what each descriptor of the ranking says.

    graph_dissimilarity: D(G, G~) whatever ranks; pairs and unmatched are its reasons. note: where D is more than the
    sum of what is listed, how.
    """

    rank: int
    shape: HitShape
    dissimilarity: float
    graph_dissimilarity: float
    endpoint_count: int
    parts: tuple[Part, ...]
    pairs: tuple[Pair, ...]
    unmatched_query: tuple[Unmatched, ...]
    unmatched_hit: tuple[Unmatched, ...]
    note: str | None = None


@dataclass(frozen=True)
class Answer:
    """Hits from most to least similar, ties by id.

    query: as it was understood, with its ``features`` and ``endpoint_count``. considered: shapes that were
    compared; buckets: endpoint count -> how many of these. left_out: described shapes that could not be compared,
    each with ``code``, ``shapes`` (how many) and ``detail``. took_ms: on the server.
    """

    query: dict[str, Any]
    hits: tuple[Hit, ...]
    considered: int
    buckets: dict[int, int]
    took_ms: float
    left_out: tuple[dict[str, Any], ...] = ()


@dataclass(frozen=True)
class DenoisingPart:
    """A filter by its arguments, and its share of the mean; as ``reebase.denoise.Part``."""

    share: float
    method: str
    iterations: int
    parameters: dict[str, Any]


@dataclass(frozen=True)
class Choice:
    """What ``auto`` picked, and why; as ``reebase.denoise.Choice``."""

    parts: tuple[DenoisingPart, ...]
    noise: float
    surface: str
    reason: str


@dataclass(frozen=True)
class Errors:
    """How far a mesh is from the truth; as ``reebase.denoise.Errors``."""

    mean_angle: float
    edge_angle: float | None
    face_normal_error: float
    visual_error: float
    displacement: float
    vertex_error: float
    volume_change: float | None


@dataclass(frozen=True)
class Denoised:
    """What was done to a mesh.

    task: under which ``denoised_bytes`` gives the mesh, for some days. choice: of ``auto``. displacement: how far
    vertices moved, ``mean`` and ``largest``, in the mesh's units. before, after: errors, where a truth was sent.
    """

    task: str
    method: str
    iterations: int
    boundary: str
    parameters: dict[str, Any]
    choice: Choice | None
    vertices: int
    faces: int
    mean_edge_length: float
    displacement: dict[str, float]
    before: Errors | None
    after: Errors | None


@dataclass(frozen=True)
class Evaluation:
    """An evaluation and its task. report: None until that succeeded, and in lists."""

    id: str
    task: Task
    request: dict[str, Any]
    report: dict[str, Any] | None
    created_at: datetime


@dataclass(frozen=True, eq=False)
class Matrix:
    """D of all pairs, float64, (n, n), row = query; row and column i belong to ``items[i]`` (name, label, ...)."""

    items: tuple[dict[str, Any], ...]
    values: npt.NDArray[np.float64]


@dataclass(frozen=True)
class ServiceLimits:
    """What a request may hold. Sizes in bytes, times in seconds."""

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


@dataclass(frozen=True)
class Formats:
    """read: name -> media type of what can be uploaded; written: what meshes are given back in."""

    read: dict[str, str]
    written: tuple[str, ...]


@dataclass(frozen=True)
class Measure:
    """A measure of D."""

    name: str
    description: str


@dataclass(frozen=True)
class Descriptor:
    """What can rank. measures: the default first. explained: whether hits say which endpoints went together. rerank:
    whether that goes with it. parts: the descriptors it compares. kept: whether the service keeps these of every
    shape. default: whether it ranks a query that names none.
    """

    name: str
    description: str
    measures: tuple[str, ...]
    explained: bool
    rerank: bool
    parts: tuple[str, ...]
    kept: bool
    default: bool


@dataclass(frozen=True)
class Coverage:
    """described: shapes under the present profile; shapes: descriptor -> how many of these have it."""

    described: int
    shapes: dict[str, int]


@dataclass(frozen=True)
class Duplicate:
    """Two shapes that are one, by id and name; the same twice where one file holds several copies.

    classes: what was done, see ``reebase.duplicates.CLASSES``. confidence: certain, strong or fair. scale: what the
    first must be multiplied by to have the second's size; units: which were taken for one another. evidence: the
    numbers. words: the finding as a sentence.
    """

    first: str
    first_name: str
    second: str
    second_name: str
    classes: tuple[str, ...]
    confidence: str
    scale: float
    units: str | None
    copies: int
    words: str
    evidence: dict[str, Any] | None


@dataclass(frozen=True)
class Duplicates:
    """What a search found. state: current, outdated or none. left_out: shapes that could not be compared. pairs: that
    were; pairs_left_out: candidates that were too many. total: of all findings, of which ``findings`` are the
    strongest.
    """

    state: str
    made_at: datetime | None
    compared: int
    left_out: int
    pairs: int
    pairs_left_out: int
    total: int
    findings: tuple[Duplicate, ...]


@dataclass(frozen=True)
class Filter:
    """A denoising filter, or ``none``, that a profile's ``denoise`` can name."""

    name: str
    description: str


@dataclass(frozen=True)
class Readiness:
    """worker_seen_at: when a worker last worked, None when none did yet; queued: tasks that wait."""

    status: str
    version: str
    worker_seen_at: datetime | None
    queued: int
