"""What the pipeline learnt of a shape, and of which version and parameters it is.

``store_description(conn, task, description, *, cleaned_sha256, ...) -> Task``: all of it, the
shape's new state and the task's success in one fenced transaction; the BLOBS are put before.
``features(conn, shape_id)``, ``skeleton(conn, shape_id)``, ``part_skeletons(conn, shape_id)``,
``health(conn, shape_id)``: raise ResultNotFound.
``labelled(conn, collection_id, profile_key, parts) -> Labelled``: what an evaluation needs.

Arrays are kept little endian, so that a database can move between machines.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from sqlalchemy import Connection, Table, select

from reebase.descriptors import Kept
from reebase.mesh.health import Health
from reebase.pipeline import PIPELINE_VERSION, Description
from reebase.skeleton.graph import Skeleton, unpack
from store import descriptors, tables, tasks
from store.errors import ResultNotFound, StaleClaim
from store.records import StoredFeatures, StoredHealth, StoredSkeleton, Task
from store.revision import bump
from store.sql import insert

__all__ = [
    "BLOBS", "Labelled", "features", "features_of_bytes", "graph_value", "health", "labelled", "not_described",
    "part_skeletons", "skeleton", "skeleton_value", "store_description", "thumbnails",
]  # fmt: skip

BLOBS = ("cleaned", "denoised", "display", "thumbnail")
"""What is kept of a shape beside its upload: the meshes (PLY), a light one (GLB) and a picture (PNG) for pages."""

_MANY = 500  # ids in one statement


@dataclass(frozen=True, eq=False)
class Labelled:
    """Shapes with a label and a description of one profile, by id; all columns have the same length.

    kept: of each part asked for, (k, w) for each shape. lacking: the names of shapes that are left out, because
    they have not all of the parts.
    """

    ids: list[str]
    names: list[str]
    labels: list[str]
    kept: dict[str, list[npt.NDArray[np.floating[Any]]]]
    lacking: list[str]


def store_description(
    conn: Connection,
    task: Task,
    description: Description,
    *,
    cleaned_sha256: str,
    denoised_sha256: str,
    display_sha256: str | None = None,
    thumbnail_sha256: str | None = None,
    limbs: bytes | None = None,
    parts: bytes | None = None,
    kept: Mapping[str, Kept] | None = None,
    refused: Mapping[str, Any] | None = None,
) -> Task:
    """Writes what a claimed describe task found, in place of what was known, and ends the task.

    limbs: the skeleton of ``extended`` in bytes; parts: those of several parts, packed; kept: of further descriptors
    by name; refused: why others found nothing to keep.
    Raises StaleClaim when the claim is over; let it leave the transaction, so that nothing is written.
    """
    if task.kind != "describe" or task.shape_id is None or task.collection_id is None:
        raise StaleClaim(f"Task {task.id} does not describe a shape.", task=task.id)
    found = np.ascontiguousarray(description.features, dtype="<f8").reshape(-1, 3)
    # Fenced first: a worker that is too late must not even touch the rows.
    said = {"without": dict(refused)} if refused else {}
    result = {"endpoint_count": len(found), "flags": list(description.health.flags), **said}
    done = tasks.succeed(conn, task, result)
    version = {"profile_key": description.profile.key, "pipeline_version": PIPELINE_VERSION}
    _replace(conn, tables.endpoint_features, task.shape_id, {
        **version, "collection_id": task.collection_id, "endpoint_count": len(found),
        "features": found.tobytes(), "revision": bump(conn),
    })  # fmt: skip
    _replace(conn, tables.skeleton, task.shape_id, {
        **version, "graph": description.skeleton.to_bytes(),
        "eigenvalues": np.ascontiguousarray(description.eigenvalues, dtype="<f8").tobytes(),
        "cleaned_sha256": cleaned_sha256, "denoised_sha256": denoised_sha256,
        "display_sha256": display_sha256, "thumbnail_sha256": thumbnail_sha256, "limbs": limbs,
        "parts": parts,
    })  # fmt: skip
    _replace(conn, tables.health, task.shape_id, {
        **version, "report": dataclasses.asdict(description.health), "seconds": dict(description.seconds),
    })  # fmt: skip
    descriptors.write(conn, task.shape_id, description.profile.key, kept or {})
    return done


def features(conn: Connection, shape_id: str) -> StoredFeatures:
    """Raises ResultNotFound."""
    row = _row(conn, tables.endpoint_features, shape_id)
    return StoredFeatures(
        shape_id, row["profile_key"], row["pipeline_version"], row["endpoint_count"],
        features_of_bytes(row["features"]), row["revision"],
    )  # fmt: skip


def skeleton(conn: Connection, shape_id: str) -> StoredSkeleton:
    """Raises ResultNotFound."""
    row = _row(conn, tables.skeleton, shape_id)
    return StoredSkeleton(
        shape_id, row["profile_key"], row["pipeline_version"], Skeleton.from_bytes(row["graph"]),
        np.frombuffer(row["eigenvalues"], dtype="<f8"), row["cleaned_sha256"], row["denoised_sha256"],
        row["display_sha256"], row["thumbnail_sha256"],
        None if row["limbs"] is None else Skeleton.from_bytes(row["limbs"]),
    )  # fmt: skip


def part_skeletons(conn: Connection, shape_id: str) -> list[Skeleton]:
    """The skeleton of each part by itself, by decreasing area. Raises ResultNotFound where they are not kept."""
    row = _row(conn, tables.skeleton, shape_id)
    if row["parts"] is not None:
        return unpack(row["parts"])
    if "several_components" in health(conn, shape_id).report.flags:
        raise ResultNotFound(
            "No skeletons of its parts are kept of the shape: one of them has none. Take that of the whole.",
            shape=shape_id,
        )
    return [Skeleton.from_bytes(row["graph"])]


def skeleton_value(
    graph: Skeleton, omega: npt.NDArray[np.float64] | None, eigenvalues: npt.NDArray[np.float64]
) -> dict[str, Any]:
    """A skeleton with the first eigenvalues as JSON, omega as of ``graph_value``."""
    return {**graph_value(graph, omega), "eigenvalues": eigenvalues.tolist()}


def graph_value(graph: Skeleton, omega: npt.NDArray[np.float64] | None) -> dict[str, Any]:
    """A skeleton as JSON. omega: of the endpoints in their order, (k, 3); none where the paths have no length."""
    nodes = zip(graph.positions.tolist(), graph.areas.tolist(), graph.bands.tolist(), strict=True)
    edges = zip(graph.edges.tolist(), graph.lengths.tolist(), graph.joins.tolist(), strict=True)
    known = omega is not None and len(omega) == len(graph.endpoints)
    rows = omega.tolist() if omega is not None and known else [None] * len(graph.endpoints)
    return {
        "nodes": [{"position": p, "area": a, "band": b} for p, a, b in nodes],
        "edges": [{"nodes": pair, "length": length, "join": join} for pair, length, join in edges],
        "endpoints": [
            {"node": node, "omega": row} for node, row in zip(graph.endpoints.tolist(), rows, strict=True)
        ],
        "root": int(graph.root), "cycles": int(graph.cycles),
    }  # fmt: skip


def health(conn: Connection, shape_id: str) -> StoredHealth:
    """Raises ResultNotFound."""
    row = _row(conn, tables.health, shape_id)
    report = Health.from_json(row["report"])
    return StoredHealth(shape_id, row["profile_key"], row["pipeline_version"], report, row["seconds"])


def thumbnails(conn: Connection, shape_ids: Sequence[str]) -> dict[str, str]:
    """The blobs of the pictures of these shapes, by id, of those that have one."""
    table = tables.skeleton
    found: dict[str, str] = {}
    for start in range(0, len(shape_ids), _MANY):
        some = table.c.shape_id.in_(shape_ids[start : start + _MANY])
        columns = select(table.c.shape_id, table.c.thumbnail_sha256).where(some, table.c.thumbnail_sha256.is_not(None))
        found.update((row.shape_id, row.thumbnail_sha256) for row in conn.execute(columns))
    return found


def labelled(
    conn: Connection, collection_id: str, profile_key: str, parts: Sequence[str] = (descriptors.SRG,)
) -> Labelled:
    """All shapes of the collection with a label and a description under this profile, by id."""
    shape = tables.shape
    mine = (shape.c.collection_id == collection_id, shape.c.label.is_not(None))
    columns = select(shape.c.id, shape.c.name, shape.c.label).where(*mine, tables.present)
    known = {row.id: row for row in conn.execute(columns)}
    found = Labelled([], [], [], {part: [] for part in parts}, [])
    for one in descriptors.described(conn, parts, profile_key, *mine):
        if len(one.kept) == len(parts):
            found.ids.append(one.shape_id)
            found.names.append(known[one.shape_id].name)
            found.labels.append(known[one.shape_id].label)
            for part, kept in one.kept.items():
                found.kept[part].append(kept)
        elif one.current:
            found.lacking.append(known[one.shape_id].name)
    return found


def features_of_bytes(stored: bytes) -> npt.NDArray[np.float64]:
    """The (k, 3) array of a row of ``endpoint_features``; read-only."""
    return np.frombuffer(stored, dtype="<f8").reshape(-1, 3)


def _row(conn: Connection, table: Table, shape_id: str) -> Any:
    row = conn.execute(select(table).where(table.c.shape_id == shape_id)).mappings().first()
    if row is None:
        raise not_described(conn, shape_id)
    return row


def not_described(conn: Connection, shape_id: str, why: str = "") -> ResultNotFound:
    """The refusal for a shape without results: which of waiting, failed and cancelled it is. why: said first."""
    shape = tables.shape
    row = conn.execute(select(shape.c.state, shape.c.task_id).where(shape.c.id == shape_id)).first()
    if row is None or row.task_id is None:
        return ResultNotFound(why or None, shape=shape_id)
    task = tasks.get(conn, row.task_id)
    details: dict[str, Any] = {"shape": shape_id, "state": row.state, "task": task.id}
    if task.state == "failed":
        error = dict(task.error_detail or {})
        message = str(error.pop("message", task.error_code))
        said = f"The shape could not be described: {message}"
        details["error"] = {"code": task.error_code, "detail": message, "details": error}
    elif task.state == "running":
        said = f"The shape is still being described (stage {task.stage or 'starting'})."
    elif task.state == "queued":
        said = "The shape waits to be described."
    else:
        said = f"The shape's task is {task.state}."
    return ResultNotFound(f"{why} {said}".strip(), **details)


def _replace(conn: Connection, table: Table, shape_id: str, values: dict[str, Any]) -> None:
    row = {"shape_id": shape_id, **values}
    keys = [column.name for column in table.primary_key]
    changed = {name: value for name, value in row.items() if name not in keys}
    conn.execute(
        insert(conn, table).values(row).on_conflict_do_update(index_elements=keys, set_=changed)
    )  # fmt: skip

