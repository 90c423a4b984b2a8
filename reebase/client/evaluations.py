"""Calls about evaluations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from reebase.client import received
from reebase.client.records import Evaluation, Matrix
from reebase.client.requests import Requests, given, segment

__all__ = ["EvaluationCalls"]


class EvaluationCalls(Requests):
    """How good the rankings are."""

    def start_evaluation(
        self, *, collection: str | None = None, synthetic: Mapping[str, Any] | None = None,
        profile: Mapping[str, Any] | None = None, descriptor: str | None = None, measure: str | None = None,
        rerank: bool | None = None, bootstrap: int = 1000,
    ) -> Evaluation:  # fmt: skip
        """Start an evaluation of a collection with labels, or of the synthetic set.

        synthetic: its options, as ``{"per_class": 25, "seed": 0}``; profile: of the pipeline, for the synthetic set.
        descriptor: by default what queries rank by, or ``srg`` where only a measure is given.
        Then ``wait(evaluation.task)`` and ``evaluation(evaluation.id).report``.
        Raises ServiceError: ``validation_error``, ``unknown_name``, ``collection_not_found``.
        """
        body = given({
            "collection": collection, "synthetic": None if synthetic is None else dict(synthetic),
            "profile": None if profile is None else dict(profile), "descriptor": descriptor, "measure": measure,
            "rerank": rerank, "bootstrap": bootstrap,
        })  # fmt: skip
        return self._get(received.evaluation_of, "/v1/evaluations", method="POST", creates=True, json=body)

    def evaluations(self) -> Iterator[Evaluation]:
        """Evaluations, newest first."""
        return self._pages(received.evaluation_of, "/v1/evaluations", {})

    def evaluation(self, evaluation: str) -> Evaluation:
        """An evaluation with its task and, once that succeeded, its report."""
        return self._get(received.evaluation_of, f"/v1/evaluations/{segment(evaluation)}")

    def plot(self, evaluation: str, plot: str, *, theme: str = "light") -> bytes:
        """A plot as SVG: ``precision_recall``, ``matrix`` or ``confusion``. theme: ``light`` or ``dark``.

        Raises ServiceError: ``result_not_found`` until the evaluation succeeded.
        """
        path = f"/v1/evaluations/{segment(evaluation)}/plots/{segment(plot)}.svg"
        return self._http.request("GET", path, params={"theme": theme}).content

    def matrix(self, evaluation: str) -> Matrix:
        """The dissimilarity matrix. Raises ServiceError: ``result_not_found`` until the evaluation succeeded."""

        def made(found: Mapping[str, Any]) -> Matrix:
            return Matrix(tuple(found["items"]), np.array(found["matrix"], dtype=np.float64))

        return self._get(made, f"/v1/evaluations/{segment(evaluation)}/matrix")

    def delete_evaluation(self, evaluation: str) -> None:
        """Delete an evaluation, its matrix and its task, which stops if it runs."""
        self._http.request("DELETE", f"/v1/evaluations/{segment(evaluation)}")
