"""Duplicates: each kind of copy is found and told as what it is, a different shape is not, and nothing else is said."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.duplicates import CLASSES, NUMBERS, Candidate, Shape, candidates, find_duplicates, signature
from reebase.duplicates.alignment import Similarity, fitted
from reebase.errors import ParameterError
from reebase.evaluation.disturb import DISTURBANCES
from reebase.evaluation.synthetic import synthetic_shape
from reebase.mesh import Mesh, clean
from tests.shapes import (
    capsule,
    cube,
    cylinder,
    grid,
    icosphere,
    joined,
    moebius,
    moved,
    rotation,
    tetrahedron,
    torus,
    uv_sphere,
)

EXPECTED = {
    "exported": {"same_mesh"}, "shuffled": {"same_mesh"}, "moved": {"same_mesh", "moved"},
    "in_inches": {"same_mesh", "rescaled"}, "rescaled": {"same_mesh", "rescaled"},
    "mirrored": {"same_mesh", "moved", "mirrored"}, "remeshed": {"remeshed", "moved"},
    "decimated": {"decimated", "moved"}, "noisy": {"noisy", "moved"}, "copies": {"same_mesh", "copies"},
}  # fmt: skip


def drawn(label: str = "hands", index: int = 0) -> Mesh:
    return clean(synthetic_shape(label, index, vertices=1000, rotation=False, scale=False).mesh)[0]


@pytest.fixture(scope="module")
def hand() -> Mesh:
    return drawn()


@pytest.mark.parametrize("name", list(DISTURBANCES))
def test_each_copy_is_found_and_told_as_what_it_is(hand: Mesh, name: str) -> None:
    copy = clean(DISTURBANCES[name](hand, np.random.default_rng(1)))[0]
    found = find_duplicates([Shape.of("a", hand), Shape.of("b", copy)])
    between = [one for one in found if one.first != one.second]
    assert len(between) == 1, [one.words for one in found]
    finding = between[0]
    assert set(finding.classes) == EXPECTED[name], finding.words
    assert list(finding.classes) == sorted(finding.classes, key=CLASSES.index)
    assert finding.evidence is not None
    if "same_mesh" in finding.classes:
        assert finding.confidence == "certain"
        assert finding.evidence.same_faces == 1.0
        assert finding.evidence.residual < 1e-4


def test_a_scale_is_told_with_the_units_that_were_taken_for_one_another(hand: Mesh) -> None:
    for factor, units in ((1 / 25.4, "inches and millimetres"), (1000, "millimetres and metres"), (1.7, None)):
        other = Mesh(hand.vertices * factor, hand.faces)
        (finding,) = find_duplicates([Shape.of("a", hand), Shape.of("b", other)])
        assert finding.scale == pytest.approx(factor, rel=1e-6)
        assert finding.units == units
        assert (units or "times as large") in finding.words


def test_the_similarity_that_was_applied_is_recovered(hand: Mesh) -> None:
    turn, shift = rotation(5), np.array([3.0, -1.0, 2.0])
    other = Mesh(1.3 * hand.vertices @ turn.T + shift, hand.faces)
    (finding,) = find_duplicates([Shape.of("a", hand), Shape.of("b", other)])
    assert finding.evidence is not None
    found = finding.evidence.similarity
    np.testing.assert_allclose(found.rotation, turn, atol=1e-9)
    np.testing.assert_allclose(found.shift, shift, atol=1e-8)
    assert found.scale == pytest.approx(1.3, rel=1e-10)
    angle = np.degrees(np.arccos((np.trace(turn) - 1) / 2))
    assert found.degrees == pytest.approx(angle, abs=1e-6)


def test_a_mirror_image_is_told_from_a_turn_and_a_symmetric_shape_from_neither(hand: Mesh) -> None:
    image = Mesh(hand.vertices * [1.0, -1.0, 1.0] @ rotation(2).T, hand.faces[:, ::-1])
    (finding,) = find_duplicates([Shape.of("a", hand), Shape.of("b", image)])
    assert "mirrored" in finding.classes
    assert finding.evidence is not None
    assert finding.evidence.similarity.mirrors
    # The image of a torus is the torus.
    ring = torus(nu=36, nv=16)
    image = Mesh(ring.vertices * [1.0, -1.0, 1.0] @ rotation(2).T, ring.faces[:, ::-1])
    (finding,) = find_duplicates([Shape.of("a", ring), Shape.of("b", image)])
    assert "mirrored" not in finding.classes


def test_noise_on_a_symmetric_shape_is_no_other_triangles() -> None:
    # A bar lies on itself the other way round as well, but there its triangles do not.
    bar = capsule(3, nu=17, nv=8, along=19)
    bar = Mesh(bar.vertices * [1.0, 1.5, 1.0], bar.faces)
    copy = DISTURBANCES["noisy"](bar, np.random.default_rng(1))
    (finding,) = find_duplicates([Shape.of("a", bar), Shape.of("b", copy)])
    assert "noisy" in finding.classes and "remeshed" not in finding.classes, finding.words


def test_poses_and_kin_are_no_duplicates() -> None:
    shapes = [Shape.of(f"{label}-{i}", drawn(label, i)) for label in ("hands", "humans") for i in range(3)]
    shapes.append(Shape.of("capsule", capsule(4)))
    shapes.append(Shape.of("longer", capsule(4.6)))
    assert find_duplicates(shapes) == []


@pytest.mark.parametrize(
    "mesh",
    [tetrahedron(), cube(), grid(4, 6), moebius(), cylinder(), icosphere(1),
     joined(*(moved(cube(), (3 * i, 0, 0)) for i in range(9)))],
    ids=["tetrahedron", "cube", "plane", "moebius", "tube", "sphere", "cubes"],
)  # fmt: skip
def test_coarse_flat_open_and_symmetric_shapes_are_found_too(mesh: Mesh) -> None:
    other = clean(moved(mesh, (4, 5, 6), scale=10, seed=1))[0]
    found = [one for one in find_duplicates([Shape.of("a", clean(mesh)[0]), Shape.of("b", other)]) if one.first == "a"]
    finding = next(one for one in found if one.second == "b")
    assert finding.classes[0] == "same_mesh"
    assert finding.scale == pytest.approx(10, rel=1e-6)
    assert "mirrored" not in finding.classes


def test_a_longer_box_is_no_certain_copy() -> None:
    other = Mesh(cube().vertices * [1.0, 1.0, 1.05], cube().faces)
    assert all(one.confidence == "fair" for one in find_duplicates([Shape.of("a", cube()), Shape.of("b", other)]))
    other = Mesh(cube().vertices * [1.0, 1.0, 1.3], cube().faces)
    assert find_duplicates([Shape.of("a", cube()), Shape.of("b", other)]) == []


def test_another_tessellation_of_a_sphere_is_the_sphere() -> None:
    (finding,) = find_duplicates([Shape.of("a", icosphere(3)), Shape.of("b", moved(uv_sphere(40, 20), (9, 0, 0)))])
    assert finding.classes[0] == "remeshed"
    assert finding.scale == pytest.approx(1, abs=0.01)


def test_copies_within_one_file_are_counted(hand: Mesh) -> None:
    far = float(np.ptp(hand.vertices, axis=0).max()) * 2
    three = joined(hand, moved(hand, (far, 0, 0), seed=3), moved(hand, (0, far, 0), seed=4), torus(far / 9, far / 30))
    (finding,) = find_duplicates([Shape.of("plate", clean(three)[0])])
    assert (finding.first, finding.second, finding.copies) == ("plate", "plate", 3)
    assert "3 copies" in finding.words
    assert find_duplicates([Shape.of("two things", clean(joined(hand, moved(torus(), (far, 0, 0))))[0])]) == []


def test_more_copies_than_are_counted_are_told_as_at_least_so_many() -> None:
    for count, words in ((99, "holds 99 copies"), (150, "holds at least 100 copies")):
        plate = joined(*(moved(tetrahedron(), (4.0 * at, 0, 0)) for at in range(count)))
        (finding,) = find_duplicates([Shape.of("plate", clean(plate)[0])])
        assert finding.copies == min(count, 100)
        assert words in finding.words


def test_pairs_that_are_given_are_all_that_is_compared(hand: Mesh) -> None:
    shapes = [Shape.of(name, hand) for name in "abc"]
    (finding,) = find_duplicates(shapes, pairs=[Candidate(0.0, 0, 2)])
    assert (finding.first, finding.second) == ("a", "c")
    assert find_duplicates(shapes, pairs=[]) == []


def test_equal_bytes_need_no_comparison(hand: Mesh) -> None:
    def never() -> Mesh:
        raise AssertionError("a mesh was loaded")

    kept = signature(hand)
    (finding,) = find_duplicates([Shape("a", never, kept, "00"), Shape("b", never, kept, "00")])
    assert finding.classes == ("same_bytes",)
    assert finding.to_json()["evidence"] is None


def test_the_signature_does_not_change_with_motion_scale_or_mirroring(hand: Mesh) -> None:
    own = signature(hand)
    assert own.shape == (NUMBERS,)
    other = Mesh((hand.vertices * [-7.0, 7.0, 7.0]) @ rotation(3).T + 5, hand.faces)
    assert np.sqrt(((signature(other) - own) ** 2).mean()) < 0.03
    assert np.sqrt(((signature(drawn("ants")) - own) ** 2).mean()) > 0.03


def test_candidates_are_each_pair_once_and_refuse_other_signatures(hand: Mesh) -> None:
    own = signature(hand)
    found = list(candidates(np.stack([own, own, own + 1.0, own])))
    assert sorted((one.first, one.second) for one in found) == [(0, 1), (0, 3), (1, 3)]
    assert list(candidates(np.empty((0, NUMBERS)))) == []
    with pytest.raises(ParameterError, match="numbers"):
        list(candidates(np.zeros((3, 7))))


def test_names_must_differ(hand: Mesh) -> None:
    with pytest.raises(ParameterError, match="name"):
        find_duplicates([Shape.of("a", hand), Shape.of("a", hand)])


def test_findings_are_json(hand: Mesh) -> None:
    import json

    (finding,) = find_duplicates([Shape.of("a", hand), Shape.of("b", Mesh(hand.vertices * 10, hand.faces))])
    record = json.loads(json.dumps(finding.to_json(), allow_nan=False))
    assert record["evidence"]["residual"] < 1e-6
    assert record["units"] == "millimetres and centimetres"


@pytest.mark.parametrize("mirrors", [False, True])
def test_the_least_squares_similarity_is_exact_where_there_is_one(mirrors: bool) -> None:
    random = np.random.default_rng(0)
    points = random.standard_normal((30, 3))
    turn = rotation(8) * (-1 if mirrors else 1)
    true = Similarity(0.4, turn, np.array([1.0, 2.0, 3.0]))
    found = fitted(points, true(points))[int(mirrors)]
    np.testing.assert_allclose(found.rotation, turn, atol=1e-12)
    np.testing.assert_allclose(found(points), true(points), atol=1e-12)
    assert found.mirrors == mirrors
