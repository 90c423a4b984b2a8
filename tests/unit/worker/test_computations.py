"""What the child brings back is what the library would have given."""

from __future__ import annotations

import dataclasses
import io
import json

import numpy as np
import pytest

from reebase import pipeline
from reebase.descriptors import descriptor_named, kept, registry, surface_of
from reebase.errors import ComputationError, FormatError, TooManyVertices
from reebase.evaluation import dissimilarity_matrix, evaluate
from reebase.mesh.read import read_scalars
from reebase.mesh.write import to_bytes
from reebase.pipeline import Description, Profile
from reebase.ranking import ranking_named
from tests.shapes import torus
from worker.computations import COMPUTATIONS
from worker.stacks import pack


def run(name, arguments, source=b"", outputs=()):
    files = {output: io.BytesIO() for output in outputs}
    stages = []
    answer = COMPUTATIONS[name](arguments, io.BytesIO(source), files, lambda *step: stages.append(step))
    return answer, {name: file.getvalue() for name, file in files.items()}, stages


def arguments(**limits):
    return {"format": None, "profile": Profile(bands=32).to_json(), "limits": limits}


def test_describe_is_the_pipeline():
    data = to_bytes(torus(2.0, 0.5, 24, 12), "off")
    _, files, stages = run("describe", arguments(), data, ("description", "cleaned", "denoised"))
    found = Description.load(io.BytesIO(files["description"]))
    expected = pipeline.describe(data, Profile(bands=32))
    assert np.array_equal(found.features, expected.features)
    assert np.array_equal(found.skeleton.positions, expected.skeleton.positions)
    assert found.health == expected.health
    assert found.profile == expected.profile
    cleaned, _ = read_scalars(files["cleaned"])
    denoised, scalars = read_scalars(files["denoised"])
    assert np.array_equal(cleaned.vertices, expected.cleaned.vertices)
    assert np.array_equal(denoised.vertices, expected.denoised.vertices)
    assert np.array_equal(denoised.faces, expected.denoised.faces)
    assert np.array_equal(scalars["phi2"], expected.field, equal_nan=True)
    assert [stage for stage, _ in stages] == [*pipeline.STAGES, "write"]
    fractions = [fraction for _, fraction in stages]
    assert fractions == sorted(fractions)
    assert fractions[-1] < 1.0


def test_describe_refuses_what_reading_refuses():
    data = to_bytes(torus(2.0, 0.5, 24, 12), "off")
    with pytest.raises(TooManyVertices):
        run("describe", arguments(vertices=100), data, ("description",))
    with pytest.raises(FormatError):
        run("describe", arguments(), b"not a mesh", ("description",))


def test_what_is_kept_is_that_of_the_descriptors():
    data = to_bytes(torus(2.0, 0.5, 24, 12), "off")
    asked = {**arguments(), "descriptors": ["extended", "hks", "d2"]}
    answer, files, stages = run("describe", asked, data, ("description", "kept"))
    assert answer == {"refused": {}}
    assert ("descriptors", 0.9) in stages
    found = kept.load(io.BytesIO(files["kept"]))
    surface = surface_of(pipeline.describe(data, Profile(bands=32)))
    assert list(found) == ["extended", "hks", "d2"]
    for name, one in found.items():
        expected = np.atleast_2d(descriptor_named(name).describe(surface)).astype(np.float32)
        assert np.array_equal(one.values, expected)
        assert one.values.dtype == np.float32
    assert found["hks"].places is None
    assert found["extended"].places.shape == (len(found["extended"].values), 3)
    assert Description.load(io.BytesIO(files["description"])).seconds.keys() == {*pipeline.STAGES, "descriptors"}


@pytest.mark.parametrize(
    ("error", "detail"),
    [(ComputationError("It did not converge."), "It did not converge."), (MemoryError(), "There was not enough")],
)
def test_a_descriptor_that_cannot_describe_a_mesh_does_not_keep_the_others_from_it(monkeypatch, error, detail):
    def refuse(_):
        raise error

    broken = dataclasses.replace(descriptor_named("d2"), keep=refuse)
    monkeypatch.setattr(registry, "DESCRIPTORS", {**registry.DESCRIPTORS, "d2": broken})
    data = to_bytes(torus(2.0, 0.5, 24, 12), "off")
    asked = {**arguments(), "descriptors": ["hks", "d2", "gps"]}
    answer, files, _ = run("describe", asked, data, ("description", "kept"))
    assert answer["refused"].keys() == {"d2"}
    assert answer["refused"]["d2"]["code"] == "computation_failed"
    assert answer["refused"]["d2"]["detail"].startswith(detail)
    assert list(kept.load(io.BytesIO(files["kept"]))) == ["hks", "gps"]


def test_evaluate_ranks_by_all_parts_fused():
    fused = ranking_named("fused")
    meshes = [torus(2.0, thickness, 24, 12) for thickness in (0.5, 0.55, 0.9, 1.0, 0.2)]
    found = [kept.keep(surface_of(mesh), fused.parts)[0] for mesh in meshes]
    shapes = {part: [one[part].values for one in found] for part in fused.parts}
    asked = {"labels": list("aabbc"), "names": list("vwxyz"), "bootstrap": 0, "seed": 0}
    how = {"descriptor": "fused", "measure": None, "rerank": True}
    _, files, stages = run("evaluate", {**asked, **how}, pack(shapes), ("report", "matrix"))
    assert np.array_equal(np.load(io.BytesIO(files["matrix"])), fused.matrix(shapes))
    assert [stage for stage, _ in stages][-1] == "measures"


def test_evaluate_is_the_evaluation():
    random = np.random.default_rng(3)
    shapes = [random.uniform(0.1, 1.0, (count, 3)) for count in (2, 3, 0, 4, 2)]
    labels = ["a", "a", "b", "b", "a"]
    asked = {"labels": labels, "names": list("vwxyz"), "bootstrap": 10, "seed": 0}
    how = {"descriptor": "srg", "measure": "greedy", "rerank": False}
    _, files, _ = run("evaluate", {**asked, **how}, pack({"srg": shapes}), ("report", "matrix"))
    matrix = np.load(io.BytesIO(files["matrix"]))
    assert np.array_equal(matrix, dissimilarity_matrix(shapes, "greedy"))
    expected = evaluate(matrix, labels, list("vwxyz"), bootstrap=10, seed=0).to_json()
    report = json.loads(files["report"])
    mistakes = report.pop("mistakes")
    assert report == json.loads(json.dumps(expected))
    assert sum(map(sum, mistakes["confusion"]["counts"])) == len(mistakes["worst"]) == 5
