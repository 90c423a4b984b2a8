"""Put evaluations side by side in a report: their matrices and the thumbnails of their shapes go into a child."""

from __future__ import annotations

import json
import tempfile
import zipfile
from typing import IO, Any

from store import evaluations, faults, outputs, results
from store.records import Evaluation
from worker.claim import Claim
from worker.tools import Tools, pieces

__all__ = ["run"]

_MADE = ("page", "files")
_MOST_DRAWN = 3000  # shapes whose thumbnails go along; a report shows some dozens of them


def run(tools: Tools, claim: Claim) -> None:
    """Raises EvaluationNotFound for one that was deleted meanwhile, ChildError, and what the store raises."""
    with tools.database.read() as conn:
        found = [evaluations.get(conn, one) for one in claim.task.params["evaluations"]]
        items = found[0].items or []
        drawn = results.thumbnails(conn, [item["id"] for item in items][:_MOST_DRAWN])
    arguments = {
        "title": claim.task.params["title"],
        "entries": [{"name": name, "measure": (one.report or {}).get("measure")} for name, one in _named(found)],
    }  # fmt: skip
    with tempfile.TemporaryFile() as source:
        with claim.kept():
            _pack(tools, source, items, found, drawn)
        source.seek(0)
        with tools.sandbox.run(
            "report", arguments, source, _MADE, tick=claim.tick, progress=claim.progress
        ) as finished:
            faults.point("worker.child_done")
            with claim.kept():
                made = {name: tools.blobs.put_if_absent(pieces(finished.files[name])) for name in _MADE}
    faults.point("worker.blobs_stored")
    with tools.database.write() as conn:
        outputs.complete(conn, claim.task, {"evaluations": [one.id for one in found]}, made)
    faults.point("worker.rows_committed")


def _named(found: list[Evaluation]) -> list[tuple[str, Evaluation]]:
    """Each with a name of its own: the descriptor, and how it was compared where that alone differs."""
    named: dict[str, Evaluation] = {}
    for one in found:
        report = one.report or {}
        plain = str(report.get("descriptor", "srg")) + (" reranked" if report.get("rerank") else "")
        exact = f"{plain}, {report.get('measure')}"
        names = [plain, exact, *(f"{exact} ({number})" for number in range(2, 100))]
        named[next(name for name in names if name not in named)] = one
    return list(named.items())


def _pack(
    tools: Tools, target: IO[bytes], items: list[dict[str, Any]], found: list[Evaluation], drawn: dict[str, str]
) -> None:
    with zipfile.ZipFile(target, "w") as archive:
        archive.writestr("items.json", json.dumps(items))
        for number, one in enumerate(found):
            with archive.open(f"matrix-{number}.npy", "w", force_zip64=True) as matrix:
                for piece in tools.blobs.stream(evaluations.matrix_of(one)):
                    matrix.write(piece)
        for shape_id, sha256 in drawn.items():
            archive.writestr(f"{shape_id}.png", tools.blobs.get(sha256))
