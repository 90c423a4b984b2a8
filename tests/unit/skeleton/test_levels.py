"""Level sets at equal steps of the area."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.errors import UnknownName
from reebase.evaluation.synthetic import synthetic_shape
from reebase.mesh import Mesh
from reebase.mesh.geometry import face_areas
from reebase.pipeline import Profile, describe
from reebase.skeleton import reeb_graph
from reebase.skeleton.levels import by_area
from reebase.spectrum import eigenpairs, operator
from tests.shapes import icosphere


def test_on_a_sphere_the_area_below_a_height_is_the_height() -> None:
    """Archimedes: the cap below z has the area pi (z + 1) / 2 of 2 pi."""
    sphere = icosphere(4)
    height = sphere.vertices[:, 2]
    assert by_area(sphere, height) == pytest.approx((height + 1) / 2, abs=2e-3)


@pytest.mark.parametrize("label", ["octopuses", "spectacles"])
def test_bands_have_equal_areas(label: str) -> None:
    mesh = synthetic_shape(label, 0, vertices=4000).mesh
    phi = eigenpairs(operator(mesh), 2).fiedler
    graph = reeb_graph(mesh, phi, 16, "area")
    areas = np.bincount(graph.bands, weights=graph.areas)
    assert areas / areas.sum() == pytest.approx(np.full(16, 1 / 16), rel=0.1)


def test_order_ties_and_sign() -> None:
    mesh = icosphere(2)
    values = np.round(np.random.default_rng(0).normal(size=len(mesh.vertices)), 1)
    shares = by_area(mesh, values)
    assert by_area(mesh, -values) == pytest.approx(1 - shares, abs=1e-12)
    assert (np.diff(shares[np.argsort(values, kind="stable")]) >= 0).all()
    assert len(np.unique(shares)) == len(np.unique(values))


def test_the_shares_are_those_of_a_slow_sum_over_faces() -> None:
    mesh = synthetic_shape("crabs", 0, vertices=1000).mesh
    values = mesh.vertices[:, 0]
    areas = face_areas(mesh)
    faces = [(values[f].min(), values[f].max(), area) for f, area in zip(mesh.faces, areas, strict=True)]
    chosen = range(0, len(values), 50)
    expected = [
        sum(area * min(max((values[i] - low) / (high - low), 0.0), 1.0) for low, high, area in faces) for i in chosen
    ]
    assert by_area(mesh, values)[chosen] == pytest.approx(np.array(expected) / areas.sum(), abs=1e-9)


def test_what_rounding_separates_stays_together() -> None:
    """The faces of a cube, turned: each plateau is one value, not a slope made of rounding."""
    cube = Mesh(
        np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]),
        np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
                  [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]),
    )  # fmt: skip
    height = cube.vertices[:, 2] + 1e-15 * np.random.default_rng(0).normal(size=8)
    assert len(np.unique(by_area(cube, height))) == 2


def test_a_constant_field_is_one_node() -> None:
    sphere = icosphere(2)
    noise = 1.0 + 1e-15 * np.random.default_rng(0).normal(size=len(sphere.vertices))
    assert len(reeb_graph(sphere, noise, 32, "area").positions) == 1


def test_the_profile_names_the_levels() -> None:
    mesh = synthetic_shape("ants", 0).mesh
    width, area = (describe(mesh, Profile(denoise="none", levels=levels)) for levels in ("width", "area"))
    assert width.profile.key != area.profile.key
    assert width.field == pytest.approx(area.field)
    assert len(width.skeleton.positions) != len(area.skeleton.positions)
    with pytest.raises(UnknownName, match="area, width"):
        Profile(levels="depth")
    with pytest.raises(UnknownName):
        reeb_graph(mesh, width.field, 16, "depth")
