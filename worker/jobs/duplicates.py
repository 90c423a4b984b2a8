"""Seek near-duplicates in a collection: candidates by what is kept of shapes, evidence on their meshes in a child."""

from __future__ import annotations

import io
import json
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from typing import Any, BinaryIO

import numpy as np

from reebase.duplicates import Candidate, comparisons
from store import collections, duplicates, faults
from store.duplicates import Sought
from worker.claim import Claim, LostError
from worker.tools import Tools

__all__ = ["run"]

_PAIRS = 300
"""Pairs that one child compares: each takes up to a fifth of a second, and a child has five minutes."""

_SEVERAL = 20
"""Pairs that one with a largest component counts as: each of up to a hundred copies of that is compared."""

_BYTES = 256 << 20
"""Sum of both meshes over the pairs that one child compares: larger ones take longer, and are held in memory."""

_MOST_PAIRS = 20_000
"""Pairs that are compared of one collection, the nearest: about an hour."""

_MOST = 2000
"""Findings that are kept with their evidence, the strongest; of others only which shapes, and how sure."""


def run(tools: Tools, claim: Claim) -> None:
    """Raises LostError when the collection is gone, ChildError, BlobNotFound, and what the store raises."""
    task = claim.task
    if task.collection_id is None:
        raise LostError
    with claim.kept():
        with tools.database.read() as conn:
            found = duplicates.sought(conn, collections.by_id(conn, task.collection_id))
        every = comparisons(found.signatures)
        pairs = _nearest(every, _MOST_PAIRS)
        sizes = {place: tools.blobs.size(found.meshes[place]) for one in pairs for place in (one.first, one.second)}
        runs = list(_runs(pairs, lambda one: sizes[one.first] + sizes[one.second]))
    findings: list[dict[str, Any]] = []
    weaker: list[dict[str, Any]] = []
    done = 0
    for batch in runs:
        findings += _compared(tools, claim, found, batch, done / len(pairs), len(batch) / len(pairs))
        findings.sort(key=_strength)
        weaker += [{name: one[name] for name in ("first", "second", "confidence")} for one in findings[_MOST:]]
        del findings[_MOST:]
        done += len(batch)
    faults.point("worker.child_done")
    result = {
        "stamp": found.stamp, "compared": len(found.ids), "left_out": found.left_out, "pairs": len(pairs),
        "pairs_left_out": len(every) - len(pairs), "findings": findings, "weaker": weaker,
    }  # fmt: skip
    with tools.database.write() as conn:
        tools.queue.succeed(conn, task, result)
    faults.point("worker.rows_committed")


def _strength(finding: dict[str, Any]) -> tuple[float, str, str]:
    evidence = finding["evidence"]
    return (-1.0 if evidence is None else evidence["farthest"], finding["first"], finding["second"])


def _nearest(pairs: list[Candidate], most: int) -> list[Candidate]:
    """At most so many, in their order."""
    if len(pairs) <= most:
        return pairs
    kept = np.sort(np.argsort([one.distance for one in pairs], kind="stable")[:most])
    return [pairs[at] for at in kept]


def _runs(pairs: Sequence[Candidate], size: Callable[[Candidate], int]) -> Iterator[list[Candidate]]:
    """The pairs in their order, cut into what one child may do. Those of two shapes stay together, since the first
    that is found ends the comparison of these."""
    batch: list[Candidate] = []
    held = bytes_held = 0
    for _, group in groupby(pairs, key=lambda one: (one.first, one.second)):
        together = list(group)
        weight = sum(_SEVERAL if any(one.parts) else 1 for one in together)
        length = sum(map(size, together))
        if batch and (held + weight > _PAIRS or bytes_held + length > _BYTES):
            yield batch
            batch, held, bytes_held = [], 0, 0
        batch += together
        held, bytes_held = held + weight, bytes_held + length
    if batch:
        yield batch


def _compared(
    tools: Tools, claim: Claim, found: Sought, batch: list[Candidate], begun: float, share: float
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


def _write(tools: Tools, claim: Claim, found: Sought, batch: list[Candidate], file: BinaryIO) -> None:
    """A zip of the pairs, and of their shapes by number: the meshes, the ids as names, and the signatures."""
    places = sorted({place for one in batch for place in (one.first, one.second)})
    number = {place: at for at, place in enumerate(places)}
    pairs = [(one.distance, number[one.first], number[one.second], one.parts) for one in batch]
    with zipfile.ZipFile(file, "w") as archive, claim.kept():
        rows = io.BytesIO()
        np.save(rows, found.signatures[places])
        archive.writestr("signatures.npy", rows.getvalue())
        archive.writestr("names.json", json.dumps([found.ids[place] for place in places]))
        archive.writestr("pairs.json", json.dumps(pairs))
        for at, place in enumerate(places):
            archive.writestr(f"{at}.ply", tools.blobs.get(found.meshes[place]))
