"""Denoise an uploaded mesh in a child; the mesh becomes a blob, the numbers the task's result.

The upload, and the truth beside it, are not kept: their blob belongs to the task alone until it ended.
"""

from __future__ import annotations

from store import faults, outputs
from worker.claim import Claim, LostError
from worker.tools import Tools, pieces

__all__ = ["run"]


def run(tools: Tools, claim: Claim) -> None:
    """Raises LostError for a task without an upload, and what ``Tools.computed`` and the store raise."""
    task = claim.task
    if task.blob is None:
        raise LostError
    with tools.computed(claim, "denoise", task.params, task.blob, ("mesh",)) as finished:
        faults.point("worker.child_done")
        with claim.kept():
            mesh = tools.blobs.put_if_absent(pieces(finished.files["mesh"]))
    faults.point("worker.blobs_stored")
    with tools.database.write() as conn:
        outputs.complete(conn, task, finished.answer, {"mesh": mesh})
    faults.point("worker.rows_committed")
