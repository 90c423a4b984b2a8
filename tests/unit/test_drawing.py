"""What pages draw: thumbnails that are small and show the shape, display meshes that are light and true."""

from __future__ import annotations

import io
import json
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from reebase.errors import NoFaces
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read
from reebase.pictures.display import FIELDS, clustered, display_glb, fields_of
from reebase.pictures.thumbnail import MOST_BYTES, thumbnail
from reebase.pictures.view import View
from reebase.warm import sample
from tests.shapes import capsule, flipped, grid, icosphere, joined, moved, torus

FRONT = View(np.eye(3))


def pixels(data: bytes) -> npt.NDArray[np.float64]:
    """Rows from the top, (h, w, 4), in [0, 1]; read by another implementation."""
    from matplotlib.image import imread

    return np.asarray(imread(io.BytesIO(data), format="png")).astype(float)


@pytest.mark.parametrize("mesh", [sample(), torus(), icosphere(4), moved(capsule(), seed=3), grid(9)])
def test_a_thumbnail_is_small_and_the_same_again(mesh: Mesh) -> None:
    data = thumbnail(mesh)
    assert len(data) <= MOST_BYTES
    assert data == thumbnail(mesh)
    assert pixels(data).shape == (192, 192, 4)


def test_a_sphere_covers_its_disc_and_nothing_else() -> None:
    shown = pixels(thumbnail(icosphere(5), view=FRONT))
    # The panel's margin of 8 % leaves a radius of 0.42 of the side.
    assert shown[..., 3].sum() == pytest.approx(np.pi * (0.42 * 192) ** 2, rel=0.002)
    rows, columns = np.nonzero(shown[..., 3] == 1)
    assert (np.hypot(rows - 95.5, columns - 95.5) < 0.42 * 192).all()
    # Transparent beside it, half transparent at its edge.
    assert set(np.round(np.unique(shown[..., 3]), 2)) == {0.0, 0.25, 0.5, 0.75, 1.0}


def test_the_nearer_surface_hides_the_farther_one() -> None:
    far, near = grid(5), moved(grid(5), (0, 0, 1))
    steep = Mesh(near.vertices * [1, 1, 1] + near.vertices[:, :1] * [0, 0, 3.0], near.faces)
    alone = thumbnail(steep, view=FRONT)
    for both in (joined(far, steep), joined(steep, far)):
        assert np.array_equal(pixels(thumbnail(both, view=FRONT)), pixels(alone))


def test_a_surface_is_lit_from_either_side() -> None:
    # Of a flat panel the other side has the same brightness; in a closed surface only the order of corners turns.
    for mesh in (grid(5), icosphere(3)):
        one, other = (pixels(thumbnail(m, view=FRONT))[..., 3] for m in (mesh, flipped(mesh)))
        assert np.array_equal(one, other)
    assert np.array_equal(pixels(thumbnail(grid(5), view=FRONT)), pixels(thumbnail(flipped(grid(5)), view=FRONT)))


@pytest.mark.parametrize("unit", [1e-160, 1e-6, 1.0, 1e9, 1e150])
def test_units_do_not_matter(unit: float) -> None:
    mesh = moved(torus(), (3, 4, 5), seed=2)
    shown = pixels(thumbnail(Mesh(mesh.vertices * unit, mesh.faces)))
    assert np.abs(shown - pixels(thumbnail(mesh))).mean() < 0.01
    display_glb(Mesh(mesh.vertices * unit, mesh.faces), Mesh(mesh.vertices * unit, mesh.faces), mesh.vertices[:, 0])


def test_nothing_to_draw_is_refused() -> None:
    with pytest.raises(NoFaces):
        thumbnail(Mesh(np.zeros((3, 3)), np.empty((0, 3), np.int32)))


def test_noise_that_would_fill_the_file_loses_shades_not_its_outline() -> None:
    noise = np.random.default_rng(0)
    mesh = icosphere(6)
    rough = Mesh(mesh.vertices * (1 + 0.02 * noise.standard_normal((len(mesh.vertices), 1))), mesh.faces)
    assert len(thumbnail(rough)) <= MOST_BYTES
    assert (pixels(thumbnail(rough))[..., 3] == 1).mean() > 0.4


def glb(data: bytes) -> tuple[dict[str, Any], list[npt.NDArray[Any]]]:
    """The document and the arrays of its accessors, read as the format says."""
    assert data[:4] == b"glTF" and int.from_bytes(data[8:12], "little") == len(data)
    length = int.from_bytes(data[12:16], "little")
    document = json.loads(data[20 : 20 + length])
    start = 28 + length
    arrays = []
    for accessor in document["accessors"]:
        view = document["bufferViews"][accessor["bufferView"]]
        kind = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
        raw = data[start + view["byteOffset"] :][: view["byteLength"]]
        width = {"VEC3": 3, "SCALAR": 1}[accessor["type"]]
        array = np.frombuffer(raw, kind).reshape(-1, width)
        assert len(array) == accessor["count"]
        arrays.append(array if width > 1 else array[:, 0])
    return document, arrays


def test_a_display_mesh_has_the_surface_before_and_after_and_its_scalars() -> None:
    cleaned = moved(torus(), (1000, 2000, 3000), seed=1)
    denoised = Mesh(cleaned.vertices + 0.01 * np.sin(40 * cleaned.vertices), cleaned.faces)
    field = cleaned.vertices[:, 0].copy()
    field[:7] = np.nan
    document, arrays = glb(display_glb(cleaned, denoised, field))
    primitive = document["meshes"][0]["primitives"][0]
    at = {name: arrays[place] for name, place in primitive["attributes"].items()}
    offset = np.array(document["nodes"][0]["translation"])
    assert "scale" not in document["nodes"][0]
    # Around its own centre float32 keeps what it would lose in the file's coordinates.
    assert at["POSITION"] + offset == pytest.approx(denoised.vertices, abs=1e-6)
    before = at["POSITION"] + arrays[primitive["targets"][0]["POSITION"]] + offset
    assert before == pytest.approx(cleaned.vertices, abs=1e-6)
    assert np.array_equal(arrays[primitive["indices"]].reshape(-1, 3), denoised.faces)
    assert np.array_equal(at["_PHI2_MISSING"], np.isnan(field))
    assert at["_PHI2"][7:] == pytest.approx(field[7:])
    moved_by = np.linalg.norm(denoised.vertices - cleaned.vertices, axis=1)
    assert at["_DISPLACEMENT"] == pytest.approx(moved_by, rel=1e-6)
    assert (np.abs(at["_DISPLACEMENT_SIGNED"]) <= at["_DISPLACEMENT"] * (1 + 1e-6)).all()
    told = document["asset"]["extras"]
    assert [field["name"] for field in told["fields"]] == [field.name for field in FIELDS]
    assert told["fields"][1]["max"] == pytest.approx(moved_by.max())
    assert (told["decimated"], told["error"], told["faces"]) == (False, 0.0, len(cleaned.faces))


def test_what_moved_outwards_is_positive() -> None:
    sphere = icosphere(3)
    grown = Mesh(sphere.vertices * 1.1, sphere.faces)
    fields = fields_of(sphere, grown, np.zeros(len(sphere.vertices)))
    assert fields["displacement"] == pytest.approx(np.full(len(sphere.vertices), 0.1))
    assert fields["displacement_signed"] == pytest.approx(np.full(len(sphere.vertices), 0.1), rel=1e-3)
    shrunk = fields_of(grown, sphere, np.zeros(len(sphere.vertices)))
    assert (shrunk["displacement_signed"] < 0).all()


@pytest.mark.parametrize("most", [100, 1000, 5000])
def test_a_lighter_mesh_keeps_vertices_within_its_error(most: int) -> None:
    mesh = icosphere(5)
    light = clustered(mesh, most)
    assert most / 2 < len(light.faces) <= most
    made = light.of(mesh)
    assert np.isin(made.vertices, mesh.vertices).all()
    corners = np.sort(light.faces, axis=1)
    assert (corners[:, 0] < corners[:, 1]).all() and (corners[:, 1] < corners[:, 2]).all()
    assert len(np.unique(corners, axis=0)) == len(corners)
    # Every vertex has one that stayed within the error, which is of the order of the faces' size.
    nearest = np.sqrt(((mesh.vertices[::50, None] - made.vertices[None]) ** 2).sum(axis=2)).min(axis=1)
    assert nearest.max() <= light.error < 4 * np.sqrt(4 * np.pi / most)
    assert made.vertices == pytest.approx(made.vertices / np.linalg.norm(made.vertices, axis=1)[:, None])


def test_fields_of_a_lighter_mesh_are_those_of_the_vertices_that_stayed() -> None:
    mesh = icosphere(5)
    light = clustered(mesh, 1000)
    document, arrays = glb(display_glb(mesh, mesh, mesh.vertices[:, 2], light))
    at = {name: arrays[place] for name, place in document["meshes"][0]["primitives"][0]["attributes"].items()}
    assert at["_PHI2"] == pytest.approx(mesh.vertices[light.kept, 2])
    assert document["asset"]["extras"]["decimated"] is True
    # Our own reader takes it as the mesh that it is.
    assert len(read(display_glb(mesh, mesh, mesh.vertices[:, 2], light)).faces) == len(light.faces)
