"""What is a mesh and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reebase.errors import FaceIndexOutOfRange, MeshError, NonFiniteVertices
from reebase.mesh import Mesh

CORNERS = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        ([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]]),
        ([[0, 0, 0], [1, 0], [0, 1, 0]], [[0, 1, 2]]),
        ([["a", "b", "c"]] * 3, [[0, 1, 2]]),
        (np.ones((3, 3)) * 1j, [[0, 1, 2]]),
        ([[None] * 3] * 3, [[0, 1, 2]]),
        (CORNERS, [[0, 1]]),
        (CORNERS, [[0, 1, 2], [0, 1]]),
        (CORNERS, [[0.0, 1.0, 2.0]]),
        (CORNERS, [[True, False, True]]),
    ],
    ids=["plane", "ragged", "letters", "complex", "none", "pairs", "ragged faces", "real faces", "truths"],
)
def test_what_is_no_mesh_is_refused(vertices: Any, faces: Any) -> None:
    with pytest.raises(MeshError):
        Mesh(vertices, faces)


@pytest.mark.parametrize("face", [[0, 1, 3], [0, 1, -1], [0, 1, 2**40]])
def test_a_face_on_a_vertex_that_is_not_there_is_refused(face: list[int]) -> None:
    with pytest.raises(FaceIndexOutOfRange, match="Face 0"):
        Mesh(np.array(CORNERS), np.array([face]))


def test_only_vertices_in_use_must_be_finite() -> None:
    with pytest.raises(NonFiniteVertices):
        Mesh(np.array([*CORNERS[:2], [0, np.nan, 0]]), np.array([[0, 1, 2]]))
    assert len(Mesh(np.array([*CORNERS, [np.inf] * 3]), np.array([[0, 1, 2]])).vertices) == 4


def test_arrays_have_one_type_and_cannot_be_written() -> None:
    mesh = Mesh(CORNERS, [[0, 1, 2]])  # type: ignore[arg-type]
    assert (mesh.vertices.dtype, mesh.faces.dtype) == (np.float64, np.int32)
    for array in (mesh.vertices, mesh.faces):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    assert (Mesh([], []).vertices.shape, Mesh([], []).faces.shape) == ((0, 3), (0, 3))  # type: ignore[arg-type]
