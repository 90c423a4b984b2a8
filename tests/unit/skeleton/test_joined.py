"""The skeleton of a shape in several parts: that of the whole where it was cut, and connected where it was not."""

from __future__ import annotations

import io

import numpy as np
import pytest

from reebase import Profile, describe, dissimilarity, skeleton
from reebase.errors import UnknownName
from reebase.mesh import Mesh, clean
from reebase.mesh.geometry import face_areas
from reebase.mesh.parts import links, parts
from reebase.pipeline import MOST_PARTS, Description, skeletons_of_parts
from reebase.spectrum import eigenpairs, linked, operator
from reebase.warm import sample
from tests.shapes import capsule, cube, icosphere, joined, moved, permuted, torus

PLAIN = Profile(denoise="none")


def cut(mesh: Mesh, side, hair: float = 1e-3) -> Mesh:
    """Along edges into the faces on either side, the second moved by a hair, so that nothing is shared."""
    return joined(Mesh(mesh.vertices, mesh.faces[side]), moved(Mesh(mesh.vertices, mesh.faces[~side]), (0, 0, hair)))


def middles(mesh: Mesh):
    return mesh.vertices[mesh.faces].mean(axis=1)


@pytest.mark.parametrize("components", ["joined", "largest"])
def test_of_one_part_the_skeleton_is_what_it_was(components: str) -> None:
    one, other = skeleton(sample()), skeleton(sample(), components=components)
    for name in ("positions", "areas", "edges", "endpoints"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert not one.joins.any()
    assert describe(sample()).health.flags == ()


def test_a_figure_cut_across_has_the_endpoints_of_the_figure() -> None:
    mesh = sample()
    halves = clean(cut(mesh, middles(mesh)[:, 0] > 0.3))[0]
    whole, found = describe(mesh, PLAIN), describe(halves, PLAIN)
    assert found.health.components == 2
    assert found.health.flags == ("joined_components", "open_surface", "several_components")
    assert len(found.skeleton.endpoints) == 4 and not found.skeleton.joins.any()
    assert dissimilarity(found.features, whole.features) < 0.25
    assert dissimilarity(describe(halves, Profile(denoise="none", components="largest")).features, whole.features) > 0.5


def test_a_ring_cut_in_two_is_still_a_ring() -> None:
    mesh = torus(2.0, 0.5, 96, 32)
    assert skeleton(cut(mesh, middles(mesh)[:, 0] > 0.2)).cycles == skeleton(mesh).cycles == 1


def test_coarse_parts_that_touch_in_the_file_are_no_gaps_after_denoising() -> None:
    """A filter moves the corners of a box of twelve triangles by more than parts lie apart."""
    leg, board = (Mesh(cube().vertices * size, cube().faces) for size in ((0.3, 0.3, 3), (4, 4, 0.2)))
    legs = [moved(leg, (x, y, -1.6)) for x in (-1.8, 1.8) for y in (-1.8, 1.8)]
    found = describe(joined(board, *legs))
    assert found.health.components == 5
    assert not found.skeleton.joins.any()


def test_parts_that_overlap_go_on_in_each_other() -> None:
    limb = capsule(length=6, nu=24, along=60)
    found = skeleton(joined(limb, moved(icosphere(3), (0, 0, limb.vertices[:, 2].max() + 0.95))))
    assert len(found.endpoints) == 2 and found.cycles == 0


def test_parts_far_apart_are_connected_by_flagged_edges() -> None:
    mesh = joined(capsule(), moved(capsule(), (3, 0, 0)), moved(capsule(), (7, 0, 0)))
    found = describe(mesh, PLAIN)
    graph = found.skeleton
    assert graph.joins.sum() == 2 and graph.cycles == 0
    assert graph.areas.sum() == pytest.approx(face_areas(mesh).sum())
    assert (graph.lengths[graph.joins] > 1.5).all() and (graph.lengths[~graph.joins] < 1.0).all()
    assert np.isfinite(found.field).all()


def test_the_order_of_the_parts_does_not_matter() -> None:
    mesh = clean(cut(sample(), middles(sample())[:, 1] > 0.1))[0]
    first = describe(mesh, PLAIN)
    for seed in range(2):
        assert dissimilarity(first.features, describe(permuted(mesh, seed)[0], PLAIN).features) < 0.02


def test_the_operator_of_linked_parts_is_one_of_a_connected_surface() -> None:
    mesh = joined(icosphere(2), moved(icosphere(2), (2.5, 0, 0)))
    found = linked(operator(mesh), mesh, links(parts(mesh)))
    assert abs(found.C - found.C.T).max() == 0
    assert np.abs(found.C.sum(axis=1)).max() < 1e-12
    eigenvalues = eigenpairs(found, 4).eigenvalues
    assert np.linalg.eigvalsh(found.C.toarray())[0] > -1e-12
    assert eigenvalues[1] > 1e-3 and eigenvalues[1] < eigenpairs(operator(icosphere(2)), 2).eigenvalues[1] / 4


def test_each_part_by_itself() -> None:
    mesh = joined(moved(capsule(), (9, 0, 0)), sample(), cube())
    found = skeletons_of_parts(mesh)
    assert [len(one.endpoints) for one in found][:2] == [4, 2]
    alone = skeleton(sample())
    np.testing.assert_array_equal(found[0].positions, alone.positions)
    assert len(skeletons_of_parts(mesh, most=2)) == 2


def test_an_unknown_choice_is_refused() -> None:
    with pytest.raises(UnknownName):
        skeleton(sample(), components="some")


def test_distances_along_the_surface_see_the_largest_part() -> None:
    found = describe(joined(sample(), moved(cube(), (9, 0, 0))), Profile(denoise="none", field="geodesic_integral"))
    assert {"largest_component_only", "several_components"} <= set(found.health.flags)


def test_joins_are_kept_with_a_description() -> None:
    found = describe(joined(capsule(), moved(capsule(), (3, 0, 0))), PLAIN)
    file = io.BytesIO()
    found.save(file)
    file.seek(0)
    np.testing.assert_array_equal(Description.load(file).skeleton.joins, found.skeleton.joins)
    again = type(found.skeleton).from_bytes(found.skeleton.to_bytes())
    np.testing.assert_array_equal(again.joins, found.skeleton.joins)


def test_too_many_parts_leave_the_smallest_out(monkeypatch: pytest.MonkeyPatch) -> None:
    assert MOST_PARTS >= 10_000
    monkeypatch.setattr("reebase.pipeline.MOST_PARTS", 3)
    found = describe(joined(*[moved(cube(1 + i / 9), (3 * i, 0, 0)) for i in range(5)]), PLAIN)
    assert "small_components_left_out" in found.health.flags
    assert np.isnan(found.field[:16]).all() and np.isfinite(found.field[16:]).all()
