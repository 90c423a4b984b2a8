"""Evaluate retrieval on a labelled collection, or on the synthetic set through the very same pipeline."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.descriptors import kept
from reebase.pipeline import Description, Profile
from reebase.ranking import Ranking, ranking_named
from store import collections, evaluations, faults, results
from store.descriptors import SRG
from worker.claim import Claim, LostError
from worker.sandbox import ChildError
from worker.stacks import pack
from worker.tools import Tools, pieces

__all__ = ["run"]

_SHAPES_SHARE = 0.9  # of the whole, where shapes have to be described first


@dataclass
class _Set:
    """What is evaluated. kept: of each part of the ranking, in the order of the items. failed: shapes that could not
    be described, each with its reason. lacking: names of shapes that are left out, because they lack a part.
    """

    items: list[dict[str, Any]] = field(default_factory=list)
    kept: dict[str, list[npt.NDArray[np.floating[Any]]]] = field(default_factory=dict)
    failed: list[dict[str, Any]] = field(default_factory=list)
    lacking: list[str] = field(default_factory=list)


def run(tools: Tools, claim: Claim) -> None:
    """Raises LostError when the collection is gone, ChildError, and what the store raises."""
    params = claim.task.params
    ranking = ranking_named(params.get("descriptor", SRG), params.get("measure"), params.get("rerank"))
    if params.get("synthetic") is not None:
        profile = Profile(**(params.get("profile") or {}))
        found, begun = _synthetic(tools, claim, params["synthetic"], profile, ranking), _SHAPES_SHARE
    else:
        found, profile = _collection(tools, claim, ranking)
        begun = 0.0
    how = {"descriptor": ranking.name, "measure": ranking.measure, "rerank": ranking.rerank}
    arguments = {
        **how,
        "labels": [item["label"] for item in found.items],
        "names": [item["id"] for item in found.items],
        "bootstrap": params.get("bootstrap", 1000),
        "seed": 0,
    }
    with tools.sandbox.run(
        "evaluate", arguments, pack(found.kept), ("report", "matrix"), tick=claim.tick,
        progress=lambda stage, fraction: claim.progress(stage, begun + (1.0 - begun) * fraction),
    ) as finished:  # fmt: skip
        faults.point("worker.child_done")
        report = json.loads(finished.files["report"].read())
        with claim.kept():
            matrix = tools.blobs.put_if_absent(pieces(finished.files["matrix"]))
    faults.point("worker.blobs_stored")
    report = {
        **report, **how, "parts": dict(ranking.parts), "profile": profile.to_json(), "failed": found.failed,
        "lacking": found.lacking,
    }  # fmt: skip
    with tools.database.write() as conn:
        evaluations.complete(conn, claim.task, report, items=found.items, matrix_sha256=matrix)
    faults.point("worker.rows_committed")


def _collection(tools: Tools, claim: Claim, ranking: Ranking) -> tuple[_Set, Profile]:
    if claim.task.collection_id is None:
        raise LostError
    with tools.database.read() as conn:
        collection = collections.by_id(conn, claim.task.collection_id)
        found = results.labelled(conn, collection.id, collection.profile_key, tuple(ranking.parts))
    columns = zip(found.ids, found.names, found.labels, strict=True)
    items = [{"id": shape_id, "name": name, "label": label} for shape_id, name, label in columns]
    return _Set(items, found.kept, lacking=found.lacking), Profile(**collection.profile)


def _synthetic(
    tools: Tools, claim: Claim, options: dict[str, Any], profile: Profile, ranking: Ranking
) -> _Set:
    """Make every shape of the set and describe it, each in a child; tell how many there are so far."""
    shapes = list(_shapes(options))
    found = _Set(kept={part: [] for part in ranking.parts})
    for number, shape in enumerate(shapes):
        claim.progress(f"shape {number + 1} of {len(shapes)}", _SHAPES_SHARE * number / len(shapes))
        claim.tick()
        name, label = f"{shape['label']}-{shape['index']:02d}", shape["label"]
        try:
            own, refused = _describe(tools, claim, shape, profile, ranking)
        except ChildError as error:
            if not error.lasting:
                raise
            found.failed.append({"id": name, "label": label, "code": error.code, "detail": error.detail})
            continue
        if refused:
            found.failed.append({"id": name, "label": label, **refused})
            continue
        found.items.append({"id": name, "name": name, "label": label})
        for part, one in own.items():
            found.kept[part].append(one)
    return found


def _shapes(options: dict[str, Any]) -> Iterator[dict[str, Any]]:
    from reebase.evaluation.synthetic import CLASSES

    options = dict(options)
    per_class, classes = options.pop("per_class", 25), options.pop("classes", None) or CLASSES
    for label, index in itertools.product(classes, range(per_class)):
        yield {**options, "label": label, "index": index}


def _describe(
    tools: Tools, claim: Claim, shape: dict[str, Any], profile: Profile, ranking: Ranking
) -> tuple[dict[str, npt.NDArray[np.floating[Any]]], dict[str, Any] | None]:
    """As an upload of the shape would be: written to a file, and that file through the pipeline.

    What each part keeps, and why one of them could not describe the shape.
    """
    with (
        tools.sandbox.run("synthesise", shape, outputs=("mesh",), tick=claim.tick) as made,
        tools.described(
            claim, made.files["mesh"].read(), profile.to_json(), format="ply", progress=False,
            descriptors=[part for part in ranking.parts if part != SRG],
        ) as finished,
    ):  # fmt: skip
        own: dict[str, npt.NDArray[np.floating[Any]]] = {
            part: one.values for part, one in kept.load(finished.files["kept"]).items()
        }
        if SRG in ranking.parts:
            own[SRG] = Description.load(finished.files["description"]).features
        return own, next(iter(finished.answer["refused"].values()), None)
