"""The one path from bytes to features, on shapes whose skeleton is known."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest

from reebase import describe, dissimilarity, read, skeleton, write
from reebase.errors import ComputationError, FormatError, LimitError, NoFaces, ParameterError, UnknownName
from reebase.mesh import Mesh, to_bytes
from reebase.pipeline import STAGES, Description, Profile, profile_named
from reebase.warm import sample
from tests.shapes import grid, icosphere, joined, moved, tetrahedron, torus

PLAIN = Profile(denoise="none", bands=64)


def disturbed(mesh: Mesh, seed: int) -> Mesh:
    """The same shape, moved, turned, scaled, with its vertices and faces in another order."""
    random = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(random.normal(size=(3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    order = random.permutation(len(mesh.vertices))
    place = np.argsort(order)
    vertices = 7.3 * mesh.vertices[order] @ rotation.T + [3.0, -40.0, 11.0]
    return Mesh(vertices, place[mesh.faces][random.permutation(len(mesh.faces))])


def test_four_arms_are_four_endpoints() -> None:
    found = describe(sample(), PLAIN)
    assert len(found.skeleton.endpoints) == 4
    tips = found.skeleton.positions[found.skeleton.endpoints]
    directions = np.sort(np.arctan2(tips[:, 1], tips[:, 0]) % (2 * np.pi))
    np.testing.assert_allclose(directions, [0.6, 2.5, 3.75, 2 * np.pi - 0.6], atol=0.1)
    assert (np.linalg.norm(tips, axis=1) > 2.5).all()
    assert found.features.shape == (4, 3)


@pytest.mark.parametrize("profile", [PLAIN, Profile()], ids=["plain", "denoised"])
def test_pose_scale_and_order_do_not_matter(profile: Profile) -> None:
    # phi_2 is found to 1e-5 of its norm, and a band edge that moves by so little moves D by less than 1e-4.
    first = describe(sample(), profile)
    for seed in range(3):
        assert dissimilarity(first.features, describe(disturbed(sample(), seed), profile).features) < 1e-4


def test_the_stages_are_named_in_order_with_a_growing_fraction() -> None:
    seen: list[tuple[str, float]] = []
    found = describe(sample(), PLAIN, progress=lambda stage, fraction: seen.append((stage, fraction)))
    assert tuple(stage for stage, _ in seen) == STAGES == tuple(found.seconds)
    fractions = [fraction for _, fraction in seen]
    assert fractions == sorted(fractions) and fractions[0] == 0.0 and fractions[-1] < 1.0


def test_areas_and_field_belong_to_the_denoised_mesh() -> None:
    found = describe(sample(), Profile())
    corners = found.denoised.vertices[found.denoised.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    assert found.skeleton.areas.sum() == pytest.approx(area, rel=1e-12)
    assert np.isfinite(found.field).all() and len(found.field) == len(found.denoised.vertices)


def test_of_several_parts_the_largest_is_described_where_that_is_chosen() -> None:
    big, small = sample(), icosphere(2)
    both = Mesh(
        np.vstack([small.vertices * 0.3 + 20, big.vertices]), np.vstack([small.faces, big.faces + len(small.vertices)])
    )
    found = describe(both, replace(PLAIN, components="largest"))
    assert {"several_components", "largest_component_only"} <= set(found.health.flags)
    assert np.isnan(found.field[: len(small.vertices)]).all()
    assert np.isfinite(found.field[len(small.vertices) :]).all()
    assert dissimilarity(found.features, describe(big, PLAIN).features) < 1e-9


def test_undefined_shapes_are_flagged_not_refused() -> None:
    assert "near_degenerate_eigenvalues" in describe(icosphere(3), PLAIN).health.flags
    assert "open_surface" in describe(grid(9, 30, 1.0, 5.0), PLAIN).health.flags
    ring = describe(torus(2.0, 0.5, 80, 24), Profile(denoise="none", field="eigenfunction:1"))
    assert ring.features.shape == (0, 3)
    assert {"single_node", "no_endpoints"} <= set(ring.health.flags)


def test_a_description_survives_its_file() -> None:
    found = describe(sample(), Profile())
    file = io.BytesIO()
    found.save(file)
    file.seek(0)
    again = Description.load(file)
    np.testing.assert_array_equal(again.features, found.features)
    np.testing.assert_array_equal(again.field, found.field)
    np.testing.assert_array_equal(again.denoised.vertices, found.denoised.vertices)
    np.testing.assert_array_equal(again.skeleton.edges, found.skeleton.edges)
    assert again.health == found.health and again.profile == found.profile
    assert again.skeleton.root == found.skeleton.root and again.seconds == found.seconds


def test_a_description_of_another_version_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    file = io.BytesIO()
    describe(sample(), PLAIN).save(file)
    file.seek(0)
    monkeypatch.setattr("reebase.pipeline.PIPELINE_VERSION", 999)
    with pytest.raises(FormatError, match="version"):
        Description.load(file)


def test_the_notebook_functions_are_the_pipeline(tmp_path) -> None:
    path = tmp_path / "sample.ply"
    write(sample(), path)
    found = describe(path, PLAIN)
    graph = skeleton(read(path), bands=64)
    np.testing.assert_allclose(graph.positions, found.skeleton.positions, atol=1e-9)


def test_bytes_and_paths_and_meshes_are_the_same() -> None:
    by_bytes = describe(to_bytes(sample(), "ply"), PLAIN)
    np.testing.assert_array_equal(by_bytes.features, describe(sample(), PLAIN).features)


def test_the_thesis_by_name_is_what_its_equations_say() -> None:
    """One step of (3.5), bands of equal width in phi_2, the root nearest the centroid (Figure 4.12), one surface."""
    thesis = profile_named("thesis")
    assert (thesis.denoise, thesis.iterations, thesis.field) == ("finite_volume", 1, "fiedler")
    assert (thesis.levels, thesis.root, thesis.components) == ("width", "centroid", "largest")
    assert profile_named("default") == Profile()
    with pytest.raises(UnknownName, match="thesis"):
        profile_named("ghost")


def test_profile_key_depends_on_every_parameter() -> None:
    changes = {
        "denoise": "none", "iterations": 2, "field": "height", "bands": 16, "levels": "width",
        "saliency": "length", "threshold": 0.02, "area": "ring", "operator": "tufted",
        "components": "largest", "root": "centroid",
    }  # fmt: skip
    assert set(changes) == set(Profile().to_json())
    keys = {replace(Profile(), **{name: value}).key for name, value in changes.items()} | {Profile().key}
    assert len(keys) == len(changes) + 1
    assert Profile(**json.loads(json.dumps(Profile().to_json()))).key == Profile().key
    assert Profile(threshold=0).key == Profile(threshold=0.0).key


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"denoise": "magic"}, UnknownName),
        ({"field": "colour"}, UnknownName),
        ({"saliency": "beauty"}, UnknownName),
        ({"area": "acre"}, UnknownName),
        ({"operator": "crane"}, UnknownName),
        ({"components": "most"}, UnknownName),
        ({"root": "tree"}, UnknownName),
        ({"bands": 1}, ParameterError),
        ({"bands": 10**9}, ParameterError),
        ({"bands": 64.5}, ParameterError),
        ({"bands": "64"}, ParameterError),
        ({"iterations": 0}, ParameterError),
        ({"iterations": 1.0}, ParameterError),
        ({"threshold": None}, ParameterError),
        ({"threshold": 1.0}, ParameterError),
        ({"threshold": float("nan")}, ParameterError),
    ],
)
def test_a_profile_that_no_stage_could_use_is_refused(change, error) -> None:
    with pytest.raises(error):
        Profile(**change)


def test_a_mesh_without_faces_is_refused() -> None:
    with pytest.raises(NoFaces):
        describe(Mesh(np.zeros((3, 3)), np.zeros((0, 3), dtype=np.int32)))


@pytest.mark.parametrize("trouble", [ComputationError("too dense"), LimitError("too many"), MemoryError()])
def test_parts_that_cannot_be_joined_leave_the_largest(trouble: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise trouble

    whole = sample()
    both = joined(whole, moved(tetrahedron(), [9, 0, 0], scale=0.1))
    expected = describe(both, Profile(components="largest"))
    monkeypatch.setattr("reebase.pipeline.linked", refuse)
    found = describe(both)
    assert "largest_component_only" in found.health.flags and "joined_components" not in found.health.flags
    np.testing.assert_array_equal(found.features, expected.features)
    monkeypatch.setattr("reebase.pipeline.eigenpairs", refuse)
    with pytest.raises(type(trouble)):
        describe(whole)


def test_a_profile_is_given_by_name_too() -> None:
    assert describe(sample(), "thesis").profile == profile_named("thesis")
    with pytest.raises(UnknownName):
        describe(sample(), "ghost")
