"""No filter gives what is no number, moves a vertex alone, or turns a closed surface inside out, whatever comes in."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from reebase.denoise import BOUNDARIES, METHODS, add_noise, denoise
from reebase.mesh.geometry import signed_volume
from reebase.mesh.mesh import Mesh
from tests.shapes import capsule, icosphere, torus

CLOSED = (icosphere(2), torus(nu=20, nv=12), capsule(nu=10, nv=3, along=4))
COORDINATES = st.sampled_from([0.0, 1.0, -1.0, 0.5, 1e-9, 1e9]) | st.floats(-2, 2)


@st.composite
def soups(draw: st.DrawFn) -> Mesh:
    """Any triangles on a few vertices: repeated corners, edges of many faces, no extent, vertices without a face."""
    count = draw(st.integers(3, 9))
    vertices = draw(hnp.arrays(np.float64, (count + 2, 3), elements=COORDINATES))
    faces = draw(hnp.arrays(np.int32, (draw(st.integers(1, 14)), 3), elements=st.integers(0, count - 1)))
    return Mesh(vertices, faces)


@pytest.mark.parametrize("method", sorted(METHODS))
@settings(max_examples=20, deadline=None)
@given(mesh=soups(), boundary=st.sampled_from(sorted(BOUNDARIES)), iterations=st.integers(1, 3))
def test_any_triangles_give_numbers_and_vertices_alone_stay(
    method: str, mesh: Mesh, boundary: str, iterations: int
) -> None:
    found = denoise(mesh, method, iterations, boundary=boundary).vertices
    assert np.isfinite(found).all()
    alone = np.setdiff1d(np.arange(len(mesh.vertices)), mesh.faces)
    assert len(alone) >= 2
    assert np.array_equal(found[alone], mesh.vertices[alone])


@pytest.mark.parametrize("method", sorted(METHODS))
@settings(max_examples=6, deadline=None)
@given(
    which=st.integers(0, len(CLOSED) - 1), strength=st.floats(0, 0.6), seed=st.integers(0, 99),
    kind=st.sampled_from(["normal", "isotropic"]), iterations=st.integers(1, 3),
)  # fmt: skip
def test_a_closed_surface_stays_the_right_way_out(
    method: str, which: int, strength: float, seed: int, kind: str, iterations: int
) -> None:
    """From sixty vertices on; a full Laplacian step turns a tetrahedron, as the equation says."""
    noisy = add_noise(CLOSED[which], strength, kind, seed)
    found = denoise(noisy, method, iterations)
    assert signed_volume(noisy) > 0
    assert signed_volume(found) > 0
