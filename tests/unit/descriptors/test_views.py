"""Depth images against rays, and what must not change them."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.descriptors import Surface, descriptor_named, views
from reebase.descriptors.views_kernels import depth_images
from reebase.errors import ParameterError
from reebase.mesh import Mesh
from tests.shapes import capsule, cube, grid, icosphere, moved, rotation, torus

VIEWS = descriptor_named("views")


def lopsided() -> Mesh:
    """No two axes alike, and neither end of any of them like the other."""
    mesh = capsule(3, nu=20, nv=8, along=16)
    x, y, z = mesh.vertices.T
    return Mesh(np.stack([x * (1.5 + 0.4 * z) + 0.3 * z * z, y * (0.8 - 0.2 * z), z + 0.2 * y], axis=1), mesh.faces)


def images_of(mesh: Mesh, size: int) -> tuple[np.ndarray, np.ndarray]:
    front, back = np.empty((2, size, size))
    depth_images(mesh.vertices, mesh.faces, front, back)
    return front, back


def along_rays(mesh: Mesh, size: int) -> tuple[np.ndarray, np.ndarray]:
    """The same, each pixel's ray intersected with every triangle by solving for barycentric coordinates."""
    front, back = np.full((size, size), -np.inf), np.full((size, size), np.inf)
    for row in range(size):
        for column in range(size):
            at = (np.array([row, column]) + 0.5) * 2 / size - 1
            for corners in mesh.vertices[mesh.faces]:
                system = np.vstack([corners[:, :2].T, np.ones(3)])
                if abs(np.linalg.det(system)) < 1e-12:
                    continue
                shares = np.linalg.solve(system, [*at, 1.0])
                if (shares >= -1e-9).all():
                    depth = shares @ corners[:, 2]
                    front[row, column] = max(front[row, column], depth)
                    back[row, column] = min(back[row, column], depth)
    return front, back


@pytest.mark.parametrize(
    "mesh",
    [
        moved(torus(0.6, 0.25, 12, 8), seed=3), moved(lopsided(), scale=0.7, seed=1), cube(1.0),
        moved(grid(3, 3), (-0.5, -0.5, 0)), moved(cube(), seed=2, scale=5),
    ],
)  # fmt: skip
def test_images_equal_those_of_rays(mesh):
    for found, expected in zip(images_of(mesh, 12), along_rays(mesh, 12), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_the_sphere_is_round():
    front, back = images_of(icosphere(5, 0.8), 32)
    at = (np.arange(32) + 0.5) / 16 - 1
    squared = at[:, None] ** 2 + at**2
    inside = squared < 0.78**2
    np.testing.assert_allclose(front[inside], np.sqrt(0.64 - squared[inside]), atol=5e-3)
    np.testing.assert_allclose(front, -back, atol=1e-15)
    assert not np.isfinite(front[squared > 0.64]).any()


def test_all_views_of_a_sphere_are_one_disc():
    kept = views.describe(Surface(icosphere(4))).reshape(36, views.RINGS, views.WAVES)
    radii = (np.arange(views.RINGS) + 0.5) / views.RINGS
    facing = np.maximum(1 - (views.REACH * radii) ** 2, 0)
    expected = facing * radii**views.WEIGHT
    clear = np.abs(radii - 1 / views.REACH) > 2 / views.SIZE  # a ring beside the rim is half on it
    np.testing.assert_allclose(kept[:, clear, 0], np.broadcast_to(expected, (36, 10))[:, clear], atol=0.02)
    assert kept[:, clear, 1:].max() < 5e-3


@pytest.mark.parametrize("seed", range(4))
def test_turned_scaled_and_mirrored_it_is_the_same_shape(seed):
    mesh, describe = lopsided(), VIEWS.describe
    other = moved(Mesh(mesh.vertices @ rotation(seed), mesh.faces), (5, 6, 7), scale=0.01)
    mirrored = Mesh(mesh.vertices * (-1, 1, 1), mesh.faces[:, ::-1])
    kept = [describe(shape) for shape in (mesh, other, mirrored, capsule(3))]
    D = VIEWS.distances(kept)
    assert D[0, 1] < 1e-6 * D[0, 3]
    assert D[0, 2] < 1e-6 * D[0, 3]


def test_two_axes_that_change_places_do_not_matter():
    # Scaled a little, the second and third principal axes change places; pixels move, the shape hardly does.
    mesh = lopsided()
    turned = np.linalg.eigh(np.cov(mesh.vertices.T))[1][:, ::-1]
    at = (mesh.vertices - mesh.vertices.mean(axis=0)) @ turned
    widths = at.std(axis=0)
    first, second = (
        Mesh(at * (1, factor * widths[2] / widths[1], 1), mesh.faces) for factor in (0.97, 1.03)
    )
    D = VIEWS.distances([views.describe(Surface(shape)) for shape in (first, second, mesh)])
    assert D[0, 1] < 0.4 * D[0, 2]


def test_the_difference_is_the_least_of_all_turns():
    random = np.random.default_rng(5)
    first, second = random.random((2, 36, 100))
    turns = views._TURNS
    assert len({tuple(turn) for turn in turns.tolist()}) == 48
    expected = min(
        np.abs(a - b[turn]).sum(axis=1).mean()
        for a, b in zip(first.reshape(2, 18, 100), second.reshape(2, 18, 100), strict=True)
        for turn in turns
    )
    found = VIEWS.distances([first, second])
    assert found[0, 1] == pytest.approx(expected, rel=1e-6)  # it is summed in single precision
    turned = first.reshape(2, 18, 100)[:, turns[17]].reshape(36, 100)
    assert VIEWS.distances([first, turned])[0, 1] == 0.0
    assert VIEWS.distances([second, first])[0, 1] == found[0, 1]


def test_tessellation_hardly_matters():
    coarse, fine = (Surface(torus(1, 0.4, *size)) for size in ((48, 24), (96, 48)))
    assert coarse.body.faces.size * 4 == fine.body.faces.size
    other = Surface(torus(1, 0.6, 48, 24))
    D = VIEWS.distances([views.describe(surface) for surface in (coarse, fine, other)])
    assert D[0, 1] < 0.15 * D[0, 2]


def test_the_frames_are_those_of_a_dense_sample():
    mesh = moved(lopsided(), (1, 2, 3), seed=9)
    centroid, radius, (points, normals) = views.canonical_frames(mesh)
    random = np.random.default_rng(0)
    corners = mesh.vertices[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = random.choice(len(area), 200_000, p=area / area.sum())
    sample = np.einsum("nk,nki->ni", random.dirichlet(np.ones(3), len(chosen)), corners[chosen])
    np.testing.assert_allclose(sample.mean(axis=0), centroid, atol=0.01)
    assert np.sqrt(((sample - centroid) ** 2).sum(axis=1).mean()) == pytest.approx(radius, rel=0.01)
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[chosen] / area[chosen, None]
    for frame, moments in ((points, np.cov(sample.T)), (normals, facing.T @ facing / len(chosen))):
        np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-12)
        turned = frame.T @ moments @ frame
        assert np.abs(turned - np.diag(np.diag(turned))).max() < 0.01 * turned[0, 0]
        assert (np.diff(np.diag(turned)) < 0).all()


def test_other_arrays_are_refused():
    with pytest.raises(ParameterError, match="36 x 100"):
        VIEWS.distances([np.zeros((36, 3))])
