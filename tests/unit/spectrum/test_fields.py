"""Scalar fields by name."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.errors import ParameterError, UnknownName
from reebase.spectrum import FIELDS, eigenpairs, eigenpairs_needed, field, operator
from tests.shapes import capsule, cube

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
    assert {name.split(":")[0] for name in needed} == set(FIELDS)
    with pytest.raises(ParameterError, match="needs 7 eigenpairs; 4 were given"):
        field("eigenfunction:7", MESH, SPECTRUM)
    with pytest.raises(ParameterError, match="needs 2 eigenpairs; 0 were given"):
        field("fiedler", MESH)


@pytest.mark.parametrize("name", ["", "curvature", "Fiedler", "eigenfunction2"])
def test_refuses_an_unknown_name(name):
    with pytest.raises(UnknownName, match="eigenfunction, fiedler, height"):
        field(name, MESH, SPECTRUM)


@pytest.mark.parametrize(
    "name", ["eigenfunction:0", "eigenfunction:-1", "eigenfunction:x", "eigenfunction:", "eigenfunction:1.5",
             "eigenfunction:99999999999999999999", "eigenfunction:²", "fiedler:2", "height:w", "height:"],
)  # fmt: skip
def test_refuses_a_bad_argument(name):
    with pytest.raises(ParameterError):
        field(name, MESH, SPECTRUM)


def test_refuses_the_spectrum_of_another_mesh():
    with pytest.raises(ParameterError, match="8"):
        field("fiedler", cube(), SPECTRUM)
