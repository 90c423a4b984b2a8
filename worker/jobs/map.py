"""Map a collection: the dissimilarities of its shapes, and from these a place in the plane for each."""

from __future__ import annotations

import json

from reebase.ranking import ranking_named
from store import collections, faults, maps
from worker.claim import Claim, LostError
from worker.stacks import pack
from worker.tools import Tools

__all__ = ["run"]


def run(tools: Tools, claim: Claim) -> None:
    """Raises LostError when the collection is gone, ChildError, and what the store raises."""
    task = claim.task
    if task.collection_id is None:
        raise LostError
    ranking = ranking_named(task.params["descriptor"], None, False if task.params["descriptor"] == "fused" else None)
    with tools.database.read() as conn:
        collection = collections.by_id(conn, task.collection_id)
        found = maps.mapped(conn, collection, ranking)
    arguments = {"descriptor": ranking.name, "measure": ranking.measure}
    with tools.sandbox.run(
        "map", arguments, pack(found.kept), ("points",), tick=claim.tick, progress=claim.progress
    ) as finished:
        faults.point("worker.child_done")
        made = json.loads(finished.files["points"].read())
    points = [[shape_id, *place] for shape_id, place in zip(found.ids, made["points"], strict=True)]
    result = {
        "descriptor": ranking.name, "stamp": found.stamp, "left_out": found.left_out,
        "neighbours_kept": made["neighbours_kept"], "points": points,
    }  # fmt: skip
    with tools.database.write() as conn:
        tools.queue.succeed(conn, task, result)
    faults.point("worker.rows_committed")
