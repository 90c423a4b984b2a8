"""Fill a collection with the synthetic set: each shape is made in a child, then stored and queued as an upload is."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

from store import collections, faults, keys, shapes, tasks
from worker.claim import Claim, LostError
from worker.tools import Tools

__all__ = ["run"]


def run(tools: Tools, claim: Claim) -> None:
    """Raises LostError when the collection is gone, ChildError, QuotaExceeded, and what the store raises.

    Shapes that are there already are left as they are, so a task that was cut off goes on where it stopped.
    """
    task = claim.task
    if task.collection_id is None:
        raise LostError
    with tools.database.read() as conn:
        collections.by_id(conn, task.collection_id)
    wanted = list(_wanted(task.params["synthetic"]))
    created = 0
    for number, shape in enumerate(wanted):
        claim.progress(f"shape {number + 1} of {len(wanted)}", number / len(wanted))
        claim.tick()
        with tools.sandbox.run("synthesise", shape, outputs=("mesh",), tick=claim.tick) as made:
            mesh = made.files["mesh"].read()
        created += _add(tools, claim, shape, mesh)
    with tools.database.write() as conn:
        tools.queue.succeed(conn, task, {"shapes": len(wanted), "created": created})
    faults.point("worker.rows_committed")


def _wanted(options: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """One of each class first: whoever watches sees all of them soon."""
    from reebase.evaluation.synthetic import CLASSES

    options = dict(options)
    per_class, classes = options.pop("per_class"), options.pop("classes", None) or CLASSES
    for index, label in itertools.product(range(per_class), classes):
        yield {**options, "label": label, "index": index}


def _add(tools: Tools, claim: Claim, shape: dict[str, Any], mesh: bytes) -> bool:
    """Store one shape and queue its description; whether it is new."""
    collection_id, owner = claim.task.collection_id, claim.task.params.get("owner")
    with claim.kept():
        sha256 = tools.blobs.put_if_absent(mesh)
    faults.point("worker.blobs_stored")
    name = f"{shape['label']}-{shape['index']:02d}"
    with tools.database.write() as conn:
        tasks.check_held(conn, claim.task)
        added, created = shapes.add(
            conn, collection_id or "", sha256=sha256, bytes=len(mesh), format="ply", name=name, filename=f"{name}.ply",
            label=shape["label"], tags=("synthetic",), metadata={"seed": shape["seed"]}, owner=owner,
        )  # fmt: skip
        if created:
            if owner is not None:
                keys.check_quota(conn, keys.get(conn, owner), adding=0)
            tasks.enqueue(conn, "describe", collection_id=collection_id, shape_id=added.id)
    return created
