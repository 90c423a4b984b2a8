"""Answer a query by an uploaded mesh: describe it under the collection's profile, then search.

The upload is not kept: its blob belongs to the task alone, and once that ended the worker removes it.
"""

from __future__ import annotations

from reebase.pipeline import Description
from store import collections, faults
from store.answers import DescribedMesh, QuerySpec, answer_query
from worker.claim import Claim, LostError
from worker.tools import Tools

__all__ = ["run"]


def run(tools: Tools, claim: Claim) -> None:
    """Raises LostError for a task without an upload, and what ``Tools.described`` and the store raise."""
    task = claim.task
    if task.blob is None:
        raise LostError
    spec = QuerySpec.from_params(task.params)
    with tools.database.read() as conn:
        collection = collections.get(conn, spec.collection)
    with tools.described(claim, task.blob, collection.profile, format=task.params.get("format")) as finished:
        faults.point("worker.child_done")
        description = Description.load(finished.files["description"])
    claim.progress("search", 0.95)
    answer = answer_query(tools.database, tools.follower, spec, DescribedMesh.of(description))
    with tools.database.write() as conn:
        tools.queue.succeed(conn, task, answer)
    faults.point("worker.rows_committed")
