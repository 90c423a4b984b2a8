"""What the child brings back is what the library would have given."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest

from reebase import pipeline
from reebase.errors import FormatError, TooManyVertices
from reebase.evaluation import dissimilarity_matrix, evaluate
from reebase.mesh.read import read_scalars
from reebase.mesh.write import to_bytes
from reebase.pipeline import Description, Profile
from tests.shapes import torus
from worker.computations import COMPUTATIONS


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


def test_evaluate_is_the_evaluation():
    random = np.random.default_rng(3)
    shapes = [random.uniform(0.1, 1.0, (count, 3)) for count in (2, 3, 0, 4, 2)]
    labels = ["a", "a", "b", "b", "a"]
    stacked = io.BytesIO()
    np.savez(stacked, features=np.concatenate(shapes), offsets=np.cumsum([0, *map(len, shapes)]))
    asked = {"labels": labels, "names": list("vwxyz"), "measure": "greedy", "bootstrap": 10, "seed": 0}
    _, files, _ = run("evaluate", asked, stacked.getvalue(), ("report", "matrix"))
    matrix = np.load(io.BytesIO(files["matrix"]))
    assert np.array_equal(matrix, dissimilarity_matrix(shapes, "greedy"))
    expected = evaluate(matrix, labels, list("vwxyz"), bootstrap=10, seed=0).to_json()
    assert json.loads(files["report"]) == json.loads(json.dumps(expected))
