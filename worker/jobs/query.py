"""Answer a query by an uploaded mesh: describe it under the collection's profile, then search.

The upload is not kept: its blob belongs to the task alone, and once that ended the worker removes it. What a page
draws beside the answer is kept as long as the task: a light mesh, a thumbnail and the skeletons.
"""

from __future__ import annotations

import json

import numpy as np
import numpy.typing as npt

from reebase.descriptors import kept
from reebase.pipeline import PIPELINE_VERSION, Description
from reebase.skeleton import Skeleton
from store import collections, faults, outputs, results
from store.answers import answer_query
from store.query import Query, QuerySpec
from worker.claim import Claim, LostError
from worker.tools import Tools, pieces

__all__ = ["run"]

_DRAWN = ("display", "thumbnail")


def run(tools: Tools, claim: Claim) -> None:
    """Raises LostError for a task without an upload, and what ``Tools.described`` and the store raise."""
    task = claim.task
    if task.blob is None:
        raise LostError
    spec = QuerySpec.from_params(task.params)
    with tools.database.read() as conn:
        collection = collections.get(conn, spec.collection)
    with tools.described(
        claim, task.blob, collection.profile, format=task.params.get("format"), outputs=(*_DRAWN, "limbs"),
        descriptors=spec.descriptors,
    ) as finished:  # fmt: skip
        faults.point("worker.child_done")
        description, found = Description.load(finished.files["description"]), kept.load(finished.files["kept"])
        mesh = Query.of(description, found, finished.answer["refused"])
        with claim.kept():
            drawn = {name: tools.blobs.put_if_absent(pieces(finished.files[name])) for name in _DRAWN}
            drawn["skeleton"] = tools.blobs.put_if_absent(
                _skeleton(description, description.skeleton, description.features)
            )
            if limbs := finished.files["limbs"].read():
                drawn["limbs"] = tools.blobs.put_if_absent(_skeleton(description, Skeleton.from_bytes(limbs)))
    claim.progress("search", 0.95)
    # The first query of a large collection measures for longer than the lease lasts.
    with claim.kept():
        answer = answer_query(tools.database, tools.follower, spec, mesh)
    with tools.database.write() as conn:
        outputs.complete(conn, task, answer, drawn)
    faults.point("worker.rows_committed")


def _skeleton(
    description: Description, graph: Skeleton, omega: npt.NDArray[np.float64] | None = None
) -> bytes:
    value = {
        "shape": None, "profile_key": description.profile.key, "pipeline_version": PIPELINE_VERSION,
        **results.skeleton_value(graph, omega, description.eigenvalues),
    }  # fmt: skip
    return json.dumps(value, allow_nan=False).encode()
