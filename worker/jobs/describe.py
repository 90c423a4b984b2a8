"""Describe a shape: its bytes through the pipeline in a child, the meshes to blobs, the numbers to rows."""

from __future__ import annotations

from reebase.descriptors import DESCRIPTORS, kept
from reebase.pipeline import Description
from store import collections, descriptors, faults, results, shapes
from worker.claim import Claim, LostError
from worker.tools import Tools, pieces

__all__ = ["run"]


def run(tools: Tools, claim: Claim) -> None:
    """Raises LostError when the shape is gone, and what ``Tools.described`` and the store raise."""
    task = claim.task
    if task.collection_id is None or task.shape_id is None:
        raise LostError
    with tools.database.read() as conn:
        collection = collections.by_id(conn, task.collection_id)
        shape = shapes.get(conn, task.collection_id, task.shape_id)
        # What a shape was given once, it is given again.
        before = descriptors.names_of(conn, shape.id)
    wanted = {*tools.settings.descriptors, *task.params.get("descriptors", ()), *before}
    with tools.described(
        claim, shape.sha256, collection.profile, format=shape.format, outputs=(*results.BLOBS, "limbs", "parts"),
        descriptors=[descriptors.DUPLICATES, *(name for name in DESCRIPTORS if name in wanted)],
    ) as finished:  # fmt: skip
        faults.point("worker.child_done")
        description = Description.load(finished.files["description"])
        found = kept.load(finished.files["kept"])
        limbs = finished.files["limbs"].read() or None
        parts = finished.files["parts"].read() or None
        with claim.kept():
            blobs = {name: tools.blobs.put_if_absent(pieces(finished.files[name])) for name in results.BLOBS}
    faults.point("worker.blobs_stored")
    with tools.database.write() as conn:
        results.store_description(
            conn, task, description, cleaned_sha256=blobs["cleaned"], denoised_sha256=blobs["denoised"],
            display_sha256=blobs["display"], thumbnail_sha256=blobs["thumbnail"], limbs=limbs, parts=parts,
            kept=found, refused=finished.answer["refused"],
        )  # fmt: skip
    faults.point("worker.rows_committed")
