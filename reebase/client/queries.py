"""Calls that rank, and that denoise a mesh which is not kept."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from types import EllipsisType
from typing import Any, cast

import httpx

from reebase.client import received
from reebase.client.errors import ServiceError
from reebase.client.records import Answer, Denoised
from reebase.client.requests import Source, collection_path, given, opened, segment
from reebase.client.tasks import TaskCalls
from reebase.errors import ParameterError
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read

__all__ = ["QueryCalls"]


class QueryCalls(TaskCalls):
    """What is asked with a mesh at hand."""

    def query(
        self, collection: str, *, shape: str | None = None, source: Source | None = None, k: int = 10,
        descriptor: str | None = None, measure: str | None = None, rerank: bool | None = None,
        tolerance: int | EllipsisType | None = ..., label: str | None = None, tags: Sequence[str] = (),
        metadata: Mapping[str, Any] | None = None, max_dissimilarity: float | None = None, wait: float = 600.0,
    ) -> Answer:  # fmt: skip
        """Rank a collection by a stored shape (its id) or by a mesh that is not kept.

        k: how many hits. descriptor: what ranks, see ``descriptors``; measure: how that is compared; rerank: of
        ``fused``, whether nearest neighbours refine it. tolerance: by how much endpoint counts may differ, None for
        any. What is left out is the service's default.
        label, tags, metadata: only shapes that have them. wait: seconds for a mesh to be described.
        Raises ParameterError unless one of shape and source is given; ServiceError: ``collection_not_found``,
        ``shape_not_found``, ``result_not_found``, ``unknown_name``, and what an upload may; TaskFailed, WaitTimeout.
        """
        if (shape is None) == (source is None):
            raise ParameterError("Pass either shape= (the id of a stored shape) or source= (a mesh).")
        path = collection_path(collection) + "/query"
        asked = {
            "k": k, "descriptor": descriptor, "measure": measure, "rerank": rerank, "label": label,
            "tags": list(tags) or None,
            "metadata": None if metadata is None else dict(metadata), "max_dissimilarity": max_dissimilarity,
        }  # fmt: skip
        if source is None:
            body = {"shape": shape, **given(asked)}
            if tolerance is not ...:
                body["tolerance"] = tolerance
            return self._get(received.answer_of, path, method="POST", reads=True, json=body)
        end = time.monotonic() + wait
        form = given({**asked, "metadata": None if metadata is None else json.dumps(dict(metadata))})
        if tolerance is not ...:
            form["tolerance"] = "null" if tolerance is None else tolerance
        form["wait"] = min(max(wait, 0.0), self._poll)
        with opened(source, None) as (filename, content):
            reply = self._http.request("POST", path, creates=True, data=form, files={"file": (filename, content)})
        found = self._http.object_of(reply)
        if reply.status_code == httpx.codes.ACCEPTED:
            task = self._http.built(lambda values: received.task_of(values["task"]), found)
            found = self.wait(task, timeout=end - time.monotonic()).result or {}
        return cast(Answer, self._http.built(received.answer_of, found))

    def query_batch(self, collection: str, queries: Sequence[Mapping[str, Any]]) -> list[Answer | ServiceError]:
        """Several queries by shape, each like ``{"shape": id, "k": 5}``: in their order an answer or its refusal."""
        body = {"queries": [dict(one) for one in queries]}

        def outcomes(found: Mapping[str, Any]) -> list[Answer | ServiceError]:
            return [received.outcome_of(one) for one in found["results"]]

        return self._get(outcomes, collection_path(collection) + "/queries", method="POST", reads=True, json=body)

    def denoise(
        self, source: Source, method: str = "auto", iterations: int = 1, *, boundary: str = "curve",
        parameters: Mapping[str, Any] | None = None, truth: Source | None = None, format: str | None = None,
        wait: float = 600.0,
    ) -> Denoised:  # fmt: skip
        """Denoise a mesh that is not kept in a collection; ``denoised`` gives the resulting mesh.

        method, iterations, boundary, parameters: as of ``reebase.denoise``. truth: a mesh with the same faces, for
        the errors before and after. format: of the source, where content and file name do not tell.
        Raises ServiceError: ``unknown_name``, ``invalid_parameter``, and what an upload may; TaskFailed, WaitTimeout.
        """
        end = time.monotonic() + wait
        form = given({
            "method": method, "iterations": iterations, "boundary": boundary, "format": format,
            "parameters": json.dumps(dict(parameters or {})), "wait": min(max(wait, 0.0), self._poll),
        })  # fmt: skip
        with ExitStack() as stack:
            files = {"file": stack.enter_context(opened(source, None))}
            if truth is not None:
                files["truth"] = stack.enter_context(opened(truth, None))
            reply = self._http.request("POST", "/v1/denoise", creates=True, data=form, files=files)
        found = self._http.object_of(reply)
        if reply.status_code == httpx.codes.ACCEPTED:
            task = self._http.built(lambda values: received.task_of(values["task"]), found)
            self.wait(task, timeout=end - time.monotonic())
            return self._get(received.denoised_of, f"/v1/denoise/{segment(task.id)}")
        return cast(Denoised, self._http.built(received.denoised_of, found))

    def denoised(self, task: Denoised | str) -> Mesh:
        """The mesh that a request for denoising gave."""
        return read(self.denoised_bytes(task, format="ply"), "ply")

    def denoised_bytes(self, task: Denoised | str, *, format: str = "ply") -> bytes:
        """The same as a file: ply, glb, obj, stl or off. PLY and GLB carry ``displacement``."""
        identifier = task if isinstance(task, str) else task.task
        path = f"/v1/denoise/{segment(identifier)}/mesh"
        return self._http.request("GET", path, params={"format": format}).content
