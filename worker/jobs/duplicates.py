"""Seek near-duplicates in a collection: candidates by what is kept of shapes, evidence on their meshes in a child."""

from __future__ import annotations

import io
import json
import tempfile
import zipfile
from collections.abc import Iterator
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from reebase.duplicates import candidates
from reebase.duplicates.signature import PART
from store import collections, duplicates, faults
from store.duplicates import Sought
from worker.claim import Claim, LostError
from worker.tools import Tools

__all__ = ["run"]

_PAIRS = 300
"""Pairs that one child compares; each takes a fifth of a second, and a child has its limits."""

_MOST = 2000
"""Findings that are kept, the strongest first."""


def run(tools: Tools, claim: Claim) -> None:
    """Raises LostError when the collection is gone, ChildError, BlobNotFound, and what the store raises."""
    task = claim.task
    if task.collection_id is None:
        raise LostError
    with tools.database.read() as conn:
        found = duplicates.sought(conn, collections.by_id(conn, task.collection_id))
    batches = list(_batches(found.signatures))
    findings: list[dict[str, Any]] = []
    for number, batch in enumerate(batches):
        findings += _compared(tools, claim, found, batch, number / len(batches), 1 / len(batches))
    faults.point("worker.child_done")
    id_of = dict(zip(found.names, found.ids, strict=True))
    findings.sort(key=lambda one: (-1.0 if one["evidence"] is None else one["evidence"]["farthest"], one["words"]))
    result = {
        "stamp": found.stamp, "compared": len(found.ids), "left_out": found.left_out, "total": len(findings),
        "findings": [
            {**one, "first": id_of[one["first"]], "second": id_of[one["second"]]} for one in findings[:_MOST]
        ],
    }  # fmt: skip
    with tools.database.write() as conn:
        tools.queue.succeed(conn, task, result)
    faults.point("worker.rows_committed")


def _compared(
    tools: Tools, claim: Claim, found: Sought, batch: npt.NDArray[np.int64], begun: float, share: float
) -> list[dict[str, Any]]:
    def progress(stage: str, fraction: float) -> None:
        claim.progress(stage, begun + share * fraction)

    with tempfile.TemporaryFile() as file:
        _write(tools, claim, found, batch, file)
        file.seek(0)
        with tools.sandbox.run(
            "duplicates", {}, file, ("findings",), tick=claim.tick, progress=progress
        ) as finished:
            findings: list[dict[str, Any]] = json.loads(finished.files["findings"].read())
            return findings


def _batches(signatures: npt.NDArray[np.float64]) -> Iterator[npt.NDArray[np.int64]]:
    """The shapes that are candidates of any other, or hold several parts; those that belong together in one batch."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = len(signatures)
    if count == 0:
        return
    pairs = [(one.first, one.second) for one in candidates(signatures)]
    several = np.flatnonzero((signatures[:, :PART] != signatures[:, PART:]).any(axis=1))
    ends = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    graph = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    group = connected_components(graph, directed=False)[1]
    involved = np.union1d(ends.ravel(), several)
    weight = np.bincount(group[ends[:, 0]], minlength=count) + np.bincount(group[several], minlength=count)
    batch: list[int] = []
    held = 0
    for own in np.unique(group[involved]):
        if batch and held + weight[own] > _PAIRS:
            yield np.array(batch, dtype=np.int64)
            batch, held = [], 0
        batch += involved[group[involved] == own].tolist()
        held += int(weight[own])
    if batch:
        yield np.array(batch, dtype=np.int64)


def _write(tools: Tools, claim: Claim, found: Sought, batch: npt.NDArray[np.int64], file: BinaryIO) -> None:
    """A zip of the meshes by number, of their names and of their signatures."""
    with zipfile.ZipFile(file, "w") as archive, claim.kept():
        rows = io.BytesIO()
        np.save(rows, found.signatures[batch])
        archive.writestr("signatures.npy", rows.getvalue())
        archive.writestr("names.json", json.dumps([found.names[place] for place in batch]))
        for number, place in enumerate(batch):
            archive.writestr(f"{number}.ply", tools.blobs.get(found.meshes[place]))
