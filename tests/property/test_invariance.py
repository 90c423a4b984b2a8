"""A shape is itself however it lies, however large it is, and whatever the order of its file."""

from __future__ import annotations

from functools import cache

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from reebase.matching import dissimilarity, endpoint_features
from reebase.mesh import Mesh
from reebase.pipeline import Description, Profile, describe
from reebase.skeleton import prune, reeb_graph
from reebase.warm import sample

PROFILE = Profile(bands=64)
SOLVER = 1e-4
"""phi_2 is found to 1e-5 of its norm; D follows it within this."""

coordinates = st.floats(-1, 1)
quaternions = st.tuples(coordinates, coordinates, coordinates, coordinates).filter(lambda q: np.linalg.norm(q) > 0.1)


@cache
def original() -> Description:
    return describe(sample(), PROFILE)


def rotation(quaternion: tuple[float, float, float, float]) -> np.ndarray:
    w, x, y, z = np.array(quaternion) / np.linalg.norm(quaternion)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def distance(mesh: Mesh) -> float:
    return dissimilarity(original().features, describe(mesh, PROFILE).features)


@settings(max_examples=15)
@given(quaternions, st.tuples(*[st.floats(-100, 100)] * 3), st.floats(-6, 6))
def test_rotation_translation_and_scale_do_not_matter(quaternion, offset, exponent):
    vertices = 10.0**exponent * (sample().vertices @ rotation(quaternion).T + offset)
    assert distance(Mesh(vertices, sample().faces)) < SOLVER


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1))
def test_the_order_of_vertices_faces_and_corners_does_not_matter(seed):
    random = np.random.default_rng(seed)
    mesh = sample()
    order = random.permutation(len(mesh.vertices))
    faces = np.argsort(order)[mesh.faces][random.permutation(len(mesh.faces))]
    turns = (np.arange(3) + random.integers(0, 3, len(faces))[:, None]) % 3
    assert distance(Mesh(mesh.vertices[order], np.take_along_axis(faces, turns, axis=1))) < SOLVER


@settings(max_examples=20)
@given(st.integers(2, 200), st.floats(0, 0.2), st.sampled_from(["area", "length"]))
def test_the_sign_of_phi_2_does_not_matter(bands, threshold, saliency):
    found = original()
    first, second = (
        endpoint_features(prune(reeb_graph(found.denoised, sign * found.field, bands), threshold, saliency))
        for sign in (1.0, -1.0)
    )
    assert len(first) == len(second)
    assert dissimilarity(first, second) < 1e-9


@settings(max_examples=8)
@given(st.integers(0, 2))
def test_a_mirror_image_is_the_same_to_d(axis):
    vertices = sample().vertices.copy()
    vertices[:, axis] *= -1
    assert distance(Mesh(vertices, sample().faces[:, ::-1])) < SOLVER
