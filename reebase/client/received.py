"""From what the service sends to records. Members that this version does not know are passed over."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from datetime import datetime
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from reebase.client.errors import ServiceError
from reebase.client.records import (
    Answer,
    Choice,
    Collection,
    Counts,
    Denoised,
    DenoisingPart,
    Duplicate,
    Duplicates,
    Errors,
    Evaluation,
    Failure,
    Hit,
    HitShape,
    Pair,
    Part,
    PartMatch,
    Progress,
    Shape,
    Task,
    Unmatched,
    Upload,
)
from reebase.skeleton.graph import Skeleton

_Record = TypeVar("_Record")
Json = Mapping[str, Any]

_TUPLES = frozenset({"tags", "flags", "written", "measures", "parts"})
_MOMENTS = frozenset({"created_at", "updated_at", "started_at", "finished_at", "worker_seen_at", "made_at"})


def _plain(name: str, value: Any) -> Any:
    if value is None:
        return None
    if name in _TUPLES:
        return tuple(value)
    return datetime.fromisoformat(value) if name in _MOMENTS else value


def record(kind: type[_Record], values: Json, **ready: Any) -> _Record:
    """A record from a JSON object; ``ready``: members that are records themselves."""
    known = {f.name for f in fields(kind)}  # type: ignore[arg-type]  # every record here is a dataclass
    found = {name: _plain(name, value) for name, value in values.items() if name in known and name not in ready}
    return kind(**found, **ready)


def collection_of(values: Json) -> Collection:
    counts = values["counts"]
    endpoints = {int(count): shapes for count, shapes in counts["endpoints"].items()}
    return record(Collection, values, counts=Counts(counts["shapes"], counts["states"], endpoints))


def _failure(values: Json | None) -> Failure | None:
    return None if values is None else Failure(values["code"], values["detail"], values.get("details") or {})


def shape_of(values: Json) -> Shape:
    return record(Shape, values, error=_failure(values["error"]))


def task_of(values: Json) -> Task:
    return record(
        Task, values, progress=record(Progress, values["progress"]), error=_failure(values["error"])
    )


def upload_of(values: Json, created: bool) -> Upload:
    task = values["task"]
    return Upload(shape_of(values["shape"]), None if task is None else task_of(task), created)


def _reasons(values: Json) -> dict[str, Any]:
    return {
        "pairs": tuple(record(Pair, pair) for pair in values["pairs"]),
        "unmatched_query": tuple(record(Unmatched, one) for one in values["unmatched_query"]),
        "unmatched_hit": tuple(record(Unmatched, one) for one in values["unmatched_hit"]),
    }


def _part(values: Json) -> Part:
    matched = values["matched"]
    if matched is None:
        return record(Part, values, matched=None)
    places = None if matched["positions"] is None else tuple((x, y, z) for x, y, z in matched["positions"])
    return record(Part, values, matched=PartMatch(**_reasons(matched), positions=places, note=matched["note"]))


def _hit(values: Json) -> Hit:
    parts = tuple(_part(part) for part in values["parts"])
    return record(Hit, values, shape=record(HitShape, values["shape"]), parts=parts, **_reasons(values))


def answer_of(values: Json) -> Answer:
    return record(
        Answer, values, hits=tuple(_hit(hit) for hit in values["hits"]), left_out=tuple(values.get("left_out", ())),
        buckets={bucket["endpoint_count"]: bucket["shapes"] for bucket in values["buckets"]},
    )  # fmt: skip


def outcome_of(values: Json) -> Answer | ServiceError:
    """One item of a batch."""
    if values["answer"] is not None:
        return answer_of(values["answer"])
    return ServiceError(values["problem"].get("status"), values["problem"])


def duplicates_of(values: Json) -> Duplicates:
    findings = tuple(
        record(
            Duplicate, one, classes=tuple(one["classes"]), first=one["first"]["id"], first_name=one["first"]["name"],
            second=one["second"]["id"], second_name=one["second"]["name"],
        )
        for one in values["findings"]
    )  # fmt: skip
    return record(Duplicates, values, findings=findings)


def evaluation_of(values: Json) -> Evaluation:
    return record(Evaluation, values, task=task_of(values["task"]))


def denoised_of(values: Json) -> Denoised:
    errors, choice = values["errors"] or {}, None
    if values["choice"] is not None:
        parts = tuple(record(DenoisingPart, part) for part in values["choice"]["parts"])
        choice = record(Choice, values["choice"], parts=parts)
    both = {stage: record(Errors, errors[stage]) if errors else None for stage in ("before", "after")}
    return record(Denoised, values, choice=choice, **both)


def field_of(values: Json) -> npt.NDArray[np.float64]:
    return np.array([math.nan if one is None else one for one in values["values"]], dtype=np.float64)


def skeleton_of(found: Mapping[str, Any]) -> Skeleton:
    nodes, edges = found["nodes"], found["edges"]
    return Skeleton(
        positions=np.array([node["position"] for node in nodes], dtype=np.float64).reshape(-1, 3),
        areas=np.array([node["area"] for node in nodes], dtype=np.float64),
        ring_areas=np.full(len(nodes), np.nan),
        bands=np.array([node["band"] for node in nodes], dtype=np.int32),
        edges=np.array([edge["nodes"] for edge in edges], dtype=np.int32).reshape(-1, 2),
        lengths=np.array([edge["length"] for edge in edges], dtype=np.float64),
        endpoints=np.array([endpoint["node"] for endpoint in found["endpoints"]], dtype=np.int32),
        root=found["root"],
        joins=np.array([edge.get("join", False) for edge in edges], dtype=bool),
    )


def features_of(found: Mapping[str, Any]) -> npt.NDArray[np.float64]:
    return np.asarray(found["features"], dtype=np.float64).reshape(-1, 3)
