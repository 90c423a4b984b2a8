"""Evaluate retrieval on a labelled collection, or on the synthetic set through the very same pipeline."""

from __future__ import annotations

import io
import itertools
import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.pipeline import Description, Profile
from store import collections, evaluations, faults, results
from worker.claim import Claim, LostError
from worker.sandbox import ChildError
from worker.tools import Tools, pieces

__all__ = ["run"]

_SHAPES_SHARE = 0.9  # of the whole, where shapes have to be described first


@dataclass
class _Set:
    """What is evaluated. failed: shapes that could not be described, each with its reason."""

    items: list[dict[str, Any]] = field(default_factory=list)
    features: list[npt.NDArray[np.float64]] = field(default_factory=list)
    failed: list[dict[str, Any]] = field(default_factory=list)


def run(tools: Tools, claim: Claim) -> None:
    """Raises LostError when the collection is gone, ChildError, and what the store raises."""
    params = claim.task.params
    if params.get("synthetic") is not None:
        profile = Profile(**(params.get("profile") or {}))
        found, begun = _synthetic(tools, claim, params["synthetic"], profile), _SHAPES_SHARE
    else:
        found, profile = _collection(tools, claim)
        begun = 0.0
    stacked = io.BytesIO()
    np.savez(
        stacked,
        features=np.concatenate([np.empty((0, 3)), *found.features]),
        offsets=np.cumsum([0, *map(len, found.features)]),
    )
    arguments = {
        "labels": [item["label"] for item in found.items],
        "names": [item["id"] for item in found.items],
        "measure": params.get("measure", "matching"),
        "bootstrap": params.get("bootstrap", 1000),
        "seed": 0,
    }
    with tools.sandbox.run(
        "evaluate", arguments, stacked.getvalue(), ("report", "matrix"), tick=claim.tick,
        progress=lambda stage, fraction: claim.progress(stage, begun + (1.0 - begun) * fraction),
    ) as finished:  # fmt: skip
        faults.point("worker.child_done")
        report = json.loads(finished.files["report"].read())
        with claim.kept():
            matrix = tools.blobs.put_if_absent(pieces(finished.files["matrix"]))
    faults.point("worker.blobs_stored")
    report = {
        **report, "measure": arguments["measure"], "profile": profile.to_json(), "failed": found.failed,
    }  # fmt: skip
    with tools.database.write() as conn:
        evaluations.complete(conn, claim.task, report, items=found.items, matrix_sha256=matrix)
    faults.point("worker.rows_committed")


def _collection(tools: Tools, claim: Claim) -> tuple[_Set, Profile]:
    if claim.task.collection_id is None:
        raise LostError
    with tools.database.read() as conn:
        collection = collections.by_id(conn, claim.task.collection_id)
        found = results.labelled_features(conn, collection.id, collection.profile_key)
    columns = zip(found.ids, found.names, found.labels, strict=True)
    items = [{"id": shape_id, "name": name, "label": label} for shape_id, name, label in columns]
    return _Set(items, found.features), Profile(**collection.profile)


def _synthetic(tools: Tools, claim: Claim, options: dict[str, Any], profile: Profile) -> _Set:
    """Make every shape of the set and describe it, each in a child; tell how many there are so far."""
    shapes = list(_shapes(options))
    found = _Set()
    for number, shape in enumerate(shapes):
        claim.progress(f"shape {number + 1} of {len(shapes)}", _SHAPES_SHARE * number / len(shapes))
        claim.tick()
        name, label = f"{shape['label']}-{shape['index']:02d}", shape["label"]
        try:
            features = _describe(tools, claim, shape, profile)
        except ChildError as error:
            if not error.lasting:
                raise
            found.failed.append({"id": name, "label": label, "code": error.code, "detail": error.detail})
            continue
        found.items.append({"id": name, "name": name, "label": label})
        found.features.append(features)
    return found


def _shapes(options: dict[str, Any]) -> Iterator[dict[str, Any]]:
    from reebase.evaluation.synthetic import CLASSES

    options = dict(options)
    per_class, classes = options.pop("per_class", 25), options.pop("classes", None) or CLASSES
    for label, index in itertools.product(classes, range(per_class)):
        yield {**options, "label": label, "index": index}


def _describe(
    tools: Tools, claim: Claim, shape: dict[str, Any], profile: Profile
) -> npt.NDArray[np.float64]:
    """As an upload of the shape would be: written to a file, and that file through the pipeline."""
    with (
        tools.sandbox.run("synthesise", shape, outputs=("mesh",), tick=claim.tick) as made,
        tools.described(
            claim, made.files["mesh"].read(), profile.to_json(), format="ply", progress=False
        ) as finished,
    ):
        return Description.load(finished.files["description"]).features
