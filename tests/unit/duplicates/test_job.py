"""The job that seeks duplicates: a child gets no more pairs than it can compare, and no pair is lost."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from types import SimpleNamespace
from typing import Any, BinaryIO

import numpy as np
import pytest

from reebase.duplicates import NUMBERS, Candidate, Shape, candidates, comparisons, find_duplicates, signature
from reebase.mesh import Mesh, clean
from reebase.mesh.write import to_bytes
from store.duplicates import Sought
from tests.shapes import cube, joined, moved, tetrahedron
from worker.computations import COMPUTATIONS
from worker.jobs import duplicates as job


def test_a_component_above_the_bound_is_cut_and_every_pair_is_in_one_run() -> None:
    alike = np.random.default_rng(0).normal(0, 1e-6, (400, NUMBERS))
    alike[::7, NUMBERS // 2 :] += 1e-6
    alike[1::7, : NUMBERS // 2] = alike[1::7, NUMBERS // 2 :]
    pairs = comparisons(alike)
    assert len(pairs) > 10 * job._PAIRS
    runs = list(job._runs(pairs, lambda _: 1))
    assert [one for batch in runs for one in batch] == pairs
    assert max(map(len, runs)) <= job._PAIRS
    of = [{(one.first, one.second) for one in batch} for batch in runs]
    assert sum(map(len, of)) == len(set().union(*of)), "a pair of shapes is in two runs"


def test_large_meshes_and_copies_within_files_make_shorter_runs() -> None:
    pairs = [Candidate(0.0, 0, at) for at in range(1, 100)]
    assert {len(one) for one in job._runs(pairs, lambda _: job._BYTES // 10)} == {10, 9}
    assert [len(one) for one in job._runs(pairs[:3], lambda _: 2 * job._BYTES)] == [1, 1, 1]
    within = [Candidate(0.0, at, at, (True, True)) for at in range(40)]
    assert {len(one) for one in job._runs(within, lambda _: 1)} == {job._PAIRS // job._SEVERAL, 10}
    assert list(job._runs([], lambda _: 1)) == []


def test_the_nearest_pairs_are_kept_in_their_order() -> None:
    pairs = [Candidate(apart, at, at + 1) for at, apart in enumerate((0.3, 0.1, 0.4, 0.2))]
    assert job._nearest(pairs, 4) == pairs
    assert job._nearest(pairs, 2) == [pairs[1], pairs[3]]


def test_comparisons_are_the_candidates_and_files_of_several_components() -> None:
    one, two = signature(cube()), signature(joined(cube(), moved(tetrahedron(), (9, 0, 0))))
    rows = np.stack([two, one, one])
    found = comparisons(rows)
    assert [(pair.first, pair.second) for pair in found if pair.first == pair.second] == [(0, 0)]
    assert {pair for pair in found if pair.first != pair.second} == set(candidates(rows))
    assert [(pair.first, pair.second) for pair in found] == sorted((pair.first, pair.second) for pair in found)


class Sandbox:
    """Runs the computation here, and keeps how many pairs and meshes each run had."""

    def __init__(self) -> None:
        self.runs: list[tuple[int, int]] = []

    @contextmanager
    def run(
        self, name: str, arguments: dict[str, Any], source: BinaryIO, outputs: tuple[str, ...], *, tick: Any,
        progress: Any,
    ) -> Iterator[Any]:  # fmt: skip
        import zipfile

        with zipfile.ZipFile(source) as archive:
            meshes = [one for one in archive.namelist() if one.endswith(".ply")]
            self.runs.append((len(json.loads(archive.read("pairs.json"))), len(meshes)))
        source.seek(0)
        files: Mapping[str, io.BytesIO] = {one: io.BytesIO() for one in outputs}
        answer = COMPUTATIONS[name](arguments, source, files, progress)
        for file in files.values():
            file.seek(0)
        yield SimpleNamespace(answer=answer, files=files)


class Job:
    """The job on meshes in memory: what the store would give it, what it tells, and what it answers."""

    def __init__(self, meshes: dict[str, Mesh], monkeypatch: pytest.MonkeyPatch) -> None:
        self.sandbox, self.told, self.kept, self.result = Sandbox(), list[float](), 0, dict[str, Any]()
        data = {name: to_bytes(mesh, "ply") for name, mesh in meshes.items()}
        rows = np.array([signature(mesh) for mesh in meshes.values()])
        found = Sought([*meshes], rows, [*meshes], 0, [1])
        monkeypatch.setattr(job.duplicates, "sought", lambda *_: self._inside(found))
        monkeypatch.setattr(job.collections, "by_id", lambda *_: None)
        blobs = SimpleNamespace(get=data.__getitem__, size=lambda name: len(data[name]))
        database = SimpleNamespace(read=nullcontext, write=nullcontext)
        queue = SimpleNamespace(succeed=lambda _conn, _task, result: self.result.update(result))
        claim = SimpleNamespace(
            task=SimpleNamespace(collection_id="c"), kept=self._kept, tick=None,
            progress=lambda _, fraction: self.told.append(fraction),
        )  # fmt: skip
        tools: Any = SimpleNamespace(database=database, blobs=blobs, sandbox=self.sandbox, queue=queue)
        job.run(tools, claim)  # type: ignore[arg-type]  # what it uses of a claim

    @contextmanager
    def _kept(self) -> Iterator[None]:
        self.kept += 1
        yield
        self.kept -= 1

    def _inside(self, found: Sought) -> Sought:
        assert self.kept, "no heartbeats while the store is read"
        return found


@pytest.fixture(scope="module")
def meshes() -> dict[str, Mesh]:
    found = {f"{at}": clean(moved(cube(), (at, 0, 0), scale=1 + at, seed=at))[0] for at in range(9)}
    found["twice"] = clean(joined(cube(), moved(cube(), (5, 0, 0))))[0]
    found["other"] = tetrahedron()
    return found


def test_runs_together_find_what_one_search_finds(meshes: dict[str, Mesh], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(job, "_PAIRS", 7)
    monkeypatch.setattr(job, "_SEVERAL", 2)
    done = Job(meshes, monkeypatch)
    expected = find_duplicates([Shape.of(name, mesh) for name, mesh in meshes.items()])
    assert len(expected) > 36
    told = {(one["first"], one["second"]): (one["classes"], one["copies"]) for one in done.result["findings"]}
    assert told == {(one.first, one.second): ([*one.classes], one.copies) for one in expected}
    assert len(done.result["findings"]) == len(told)
    assert (done.result["weaker"], done.result["pairs_left_out"]) == ([], 0)
    assert len(done.sandbox.runs) > 5
    assert max(pairs for pairs, _ in done.sandbox.runs) <= 7
    assert all(shipped <= 2 * pairs for pairs, shipped in done.sandbox.runs)
    assert done.result["pairs"] == sum(pairs for pairs, _ in done.sandbox.runs)
    assert np.diff(done.told).min() > -1e-9
    assert done.told[-1] == pytest.approx(1.0)


def test_what_is_over_the_limits_is_counted(meshes: dict[str, Mesh], monkeypatch: pytest.MonkeyPatch) -> None:
    every = Job(meshes, monkeypatch).result
    monkeypatch.setattr(job, "_MOST", 5)
    monkeypatch.setattr(job, "_PAIRS", 7)
    few = Job(meshes, monkeypatch).result
    assert few["findings"] == every["findings"][:5]
    rest = {(one["first"], one["second"], one["confidence"]) for one in few["weaker"]}
    assert rest == {(one["first"], one["second"], one["confidence"]) for one in every["findings"][5:]}
    monkeypatch.setattr(job, "_MOST_PAIRS", 12)
    bounded = Job(meshes, monkeypatch).result
    assert bounded["pairs"] == 12
    assert bounded["pairs_left_out"] == every["pairs"] - 12
