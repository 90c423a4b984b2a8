"""Scalar fields by name."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.errors import ParameterError, UnknownName
from reebase.pipeline import skeleton
from reebase.spectrum import FIELDS, eigenpairs, eigenpairs_needed, field, operator
from tests.shapes import capsule, cube, grid, icosphere, moved, permuted

MESH = capsule()
SPECTRUM = eigenpairs(operator(MESH), 4)


def test_fiedler_is_phi_2_by_either_name():
    np.testing.assert_array_equal(field("fiedler", MESH, SPECTRUM), SPECTRUM.eigenvectors[:, 1])
    np.testing.assert_array_equal(field("eigenfunction:2", MESH, SPECTRUM), field("fiedler", MESH, SPECTRUM))
    np.testing.assert_array_equal(field("eigenfunction:4", MESH, SPECTRUM), SPECTRUM.eigenvectors[:, 3])
    np.testing.assert_array_equal(field("eigenfunction:1", MESH, SPECTRUM), 1.0)


def test_phi_2_of_a_capsule_rises_along_its_axis():
    height = field("height", MESH)
    assert abs(np.corrcoef(field("fiedler", MESH, SPECTRUM), height)[0, 1]) > 0.98


def test_height_is_a_coordinate():
    np.testing.assert_array_equal(field("height", MESH), MESH.vertices[:, 2])
    for i, axis in enumerate("xyz"):
        np.testing.assert_array_equal(field(f"height:{axis}", MESH), MESH.vertices[:, i])


def test_says_how_many_eigenpairs_it_needs():
    needed = {"fiedler": 2, "eigenfunction:7": 7, "height": 0, "height:x": 0, "eigenfunction": 2}
    assert {name: eigenpairs_needed(name) for name in needed} == needed
    needed |= {"auto_diffusion": 36, "auto_diffusion:0.1": 36, "geodesic_integral": 0}
    assert {name: eigenpairs_needed(name) for name in needed} == needed
    assert {name.split(":")[0] for name in needed} == set(FIELDS)
    with pytest.raises(ParameterError, match="needs 7 eigenpairs; 4 were given"):
        field("eigenfunction:7", MESH, SPECTRUM)
    with pytest.raises(ParameterError, match="needs 2 eigenpairs; 0 were given"):
        field("fiedler", MESH)


@pytest.mark.parametrize("name", ["", "curvature", "Fiedler", "eigenfunction2"])
def test_refuses_an_unknown_name(name):
    with pytest.raises(UnknownName, match="auto_diffusion, eigenfunction, fiedler, geodesic_integral, height"):
        field(name, MESH, SPECTRUM)


@pytest.mark.parametrize(
    "name", ["eigenfunction:0", "eigenfunction:-1", "eigenfunction:x", "eigenfunction:", "eigenfunction:1.5",
             "eigenfunction:99999999999999999999", "eigenfunction:²", "fiedler:2", "height:w", "height:",
             "auto_diffusion:0", "auto_diffusion:", "auto_diffusion:nan", "auto_diffusion:11", "auto_diffusion:x",
             "geodesic_integral:3"],
)  # fmt: skip
def test_refuses_a_bad_argument(name):
    with pytest.raises(ParameterError):
        field(name, MESH, SPECTRUM)


def test_refuses_the_spectrum_of_another_mesh():
    with pytest.raises(ParameterError, match="8"):
        field("fiedler", cube(), SPECTRUM)


def test_auto_diffusion_is_the_logarithm_of_the_heat_that_stays():
    pairs = eigenpairs(operator(MESH), 36)
    heat = (pairs.eigenvectors**2 * np.exp(-0.1 * pairs.eigenvalues)).sum(axis=1)
    np.testing.assert_allclose(field("auto_diffusion:0.1", MESH, pairs), np.log(heat), rtol=1e-12)
    np.testing.assert_array_equal(field("auto_diffusion", MESH, pairs), field("auto_diffusion:0.03", MESH, pairs))


def test_auto_diffusion_is_highest_at_the_ends_and_even_on_a_sphere():
    values = field("auto_diffusion", MESH, eigenpairs(operator(MESH), 36))
    height = np.abs(MESH.vertices[:, 2])
    assert height[values.argmax()] == height.max()
    assert np.corrcoef(values, height)[0, 1] > 0.9
    sphere = icosphere(4)
    assert np.ptp(field("auto_diffusion", sphere, eigenpairs(operator(sphere), 36))) < 0.02


def test_auto_diffusion_of_a_mesh_with_few_vertices_reads_what_there_is():
    pairs = eigenpairs(operator(cube()), 8)
    assert np.isfinite(field("auto_diffusion", cube(), pairs)).all()
    with pytest.raises(ParameterError, match="needs 8 eigenpairs; 7 were given"):
        field("auto_diffusion", cube(), eigenpairs(operator(cube()), 7))
    assert len(skeleton(cube(), field="auto_diffusion").positions) > 0


def test_geodesic_integral_of_a_long_strip():
    # From x to all of [0, L]: (x^2 + (L - x)^2) / 2 L, so between L / 4 and L / 2; the width hardly counts.
    mesh = grid(200, 2, 40.0, 0.2)
    x = mesh.vertices[:, 0] / 40
    expected = (x**2 + (1 - x) ** 2) - 0.5
    np.testing.assert_allclose(field("geodesic_integral", mesh), expected, atol=0.01)


def test_geodesic_integral_is_even_on_a_sphere_and_free_of_units_and_place():
    assert np.ptp(field("geodesic_integral", icosphere(4))) < 0.02
    # Which of several equally far points is taken depends on rounding and on the order of the vertices.
    found = field("geodesic_integral", MESH)
    elsewhere = moved(MESH, (3, 4, 5), scale=0.01, seed=2)
    np.testing.assert_allclose(field("geodesic_integral", elsewhere), found, atol=0.01)
    other, order = permuted(MESH, seed=1)
    np.testing.assert_allclose(field("geodesic_integral", other), found[order], atol=0.01)


def test_skeletons_by_these_fields_end_at_the_ends():
    for name in ("auto_diffusion", "geodesic_integral"):
        found = skeleton(MESH, field=name, bands=32, levels="width")
        ends = found.positions[found.endpoints]
        assert len(ends) == 2
        assert ends[:, 2].min() < -0.9 * MESH.vertices[:, 2].max()
        assert ends[:, 2].max() > 0.9 * MESH.vertices[:, 2].max()
