"""Cleaning of any triangles at all: small integer coordinates, so that everything odd happens often."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from reebase.denoise import denoise
from reebase.errors import DegenerateMesh
from reebase.mesh.clean import clean
from reebase.mesh.health import Health
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import edges, largest_component

coordinate = st.integers(0, 3)


@st.composite
def meshes(draw: st.DrawFn) -> Mesh:
    vertices = draw(st.lists(st.tuples(coordinate, coordinate, coordinate), min_size=3, max_size=14))
    index = st.integers(0, len(vertices) - 1)
    faces = draw(st.lists(st.tuples(index, index, index), min_size=1, max_size=30))
    return Mesh(np.array(vertices, dtype=float), np.array(faces))


def cleaned(mesh: Mesh) -> tuple[Mesh, Health] | None:
    try:
        return clean(mesh)
    except DegenerateMesh:
        return None


@given(meshes())
@settings(derandomize=True, max_examples=150, deadline=None)
def test_what_comes_out_is_clean(mesh: Mesh) -> None:
    found = cleaned(mesh)
    if found is None:
        return
    result, health = found
    corners = result.vertices[result.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert areas.min() > 0
    assert len(np.unique(result.vertices, axis=0)) == len(result.vertices)
    assert len(np.unique(np.sort(result.faces, axis=1), axis=0)) == len(result.faces)
    assert np.array_equal(np.unique(result.faces), np.arange(len(result.vertices)))
    assert {tuple(v) for v in result.vertices.tolist()} <= {tuple(v) for v in mesh.vertices.tolist()}
    assert health.closed == (health.boundary_edges == 0) == (health.boundary_loops == 0)
    assert health.volume is None or health.volume >= -1e-9
    assert 0 < health.largest_component_share <= 1


@given(meshes())
@settings(derandomize=True, max_examples=150, deadline=None)
def test_cleaning_again_changes_nothing(mesh: Mesh) -> None:
    found = cleaned(mesh)
    if found is None:
        return
    again, health = clean(found[0])
    assert health.repairs == {}
    assert np.array_equal(again.vertices, found[0].vertices)
    assert np.array_equal(again.faces, found[0].faces)


@given(meshes(), st.integers(0, 9))
@settings(derandomize=True, max_examples=150, deadline=None)
def test_the_largest_component_is_one_component_and_clean(mesh: Mesh, seed: int) -> None:
    found = cleaned(mesh)
    if found is None:
        return
    part, index = largest_component(found[0])
    assert edges(part.faces).components[0] == 1
    assert np.array_equal(found[0].vertices[index], part.vertices)
    assert clean(part)[1].components == 1
    share = clean(part)[1].area / found[1].area
    assert abs(share - found[1].largest_component_share) < 1e-12


@given(meshes(), st.sampled_from(["finite_volume", "laplacian"]))
@settings(derandomize=True, max_examples=150, deadline=None)
def test_denoising_anything_gives_finite_positions(mesh: Mesh, method: str) -> None:
    for boundary in ("curve", "free"):
        assert np.isfinite(denoise(mesh, method, 3, boundary=boundary).vertices).all()
