"""Fusion and diffusion: what holds for any distances, closed forms, slow twins."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.errors import ParameterError
from reebase.ranking import PARTS, fuse, fused_matrix, rerank, reranked_matrix, statistics


def distances(points: np.ndarray, seed: int = 0) -> dict[str, np.ndarray]:
    """Of each part the distances in another projection of the same points."""
    random = np.random.default_rng(seed)
    out = {}
    for part in PARTS:
        seen = points @ random.normal(size=(points.shape[1], 3))
        out[part] = np.linalg.norm(seen[:, None] - seen[None], axis=2)
    return out


def clusters(count: int = 4, size: int = 8, spread: float = 0.1, seed: int = 1) -> np.ndarray:
    random = np.random.default_rng(seed)
    return np.repeat(random.normal(size=(count, 4)), size, axis=0) + spread * random.normal(size=(count * size, 4))


POINTS = clusters()
ALL = distances(POINTS)


def test_a_stored_query_ranks_as_its_row_of_the_matrix():
    known = statistics(ALL, np.arange(len(POINTS)))
    F = fused_matrix(ALL)
    np.testing.assert_array_equal(F, F.T)
    np.testing.assert_array_equal(np.diag(F), 0.0)
    for i in (0, 9, 31):
        own = {part: known.scales[part][i] for part in PARTS}
        np.testing.assert_array_equal(fuse({part: ALL[part][i] for part in PARTS}, own, known).dissimilarities, F[i])


def test_shares_are_parts_of_one():
    known = statistics(ALL, np.arange(len(POINTS)))
    fused = fuse({part: ALL[part][3] for part in PARTS}, {part: known.scales[part][3] for part in PARTS}, known)
    assert set(fused.shares) == set(PARTS)
    np.testing.assert_allclose(sum(fused.shares.values()), 1.0)
    assert all((share >= 0).all() for share in fused.shares.values())


@pytest.mark.parametrize("part", PARTS)
def test_no_part_has_a_unit(part):
    F = fused_matrix(ALL)
    np.testing.assert_allclose(fused_matrix({**ALL, part: 1000 * ALL[part]}), F, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("part", PARTS)
def test_what_comes_nearer_in_one_part_comes_nearer(part):
    known = statistics(ALL, np.arange(len(POINTS)))
    own = {each: known.scales[each][0] for each in PARTS}
    rows = {each: ALL[each][0] for each in PARTS}
    before = fuse(rows, own, known).dissimilarities
    after = fuse({**rows, part: 0.5 * rows[part]}, own, known)
    assert (after.dissimilarities[1:] < before[1:]).all()


def test_a_query_from_outside_has_the_scales_that_it_would_have_inside():
    inside = statistics(ALL, np.arange(len(POINTS)))
    others = np.arange(len(POINTS) - 1)
    outside = statistics({part: ALL[part][-1:, others] for part in PARTS}, np.full(len(others), -1))
    for part in PARTS:
        assert outside.scales[part] == pytest.approx(inside.scales[part][-1:])


def test_some_of_the_shapes_have_the_scales_that_they_have_among_all():
    references = np.arange(0, len(POINTS), 2)
    full = statistics({part: ALL[part][:, references] for part in PARTS}, references)
    some = [4, 1, 2]
    among = np.where(np.isin(references, some), [{4: 0, 2: 2}.get(int(one), 0) for one in references], -1)
    found = statistics({part: ALL[part][np.ix_(some, references)] for part in PARTS}, among)
    for part in PARTS:
        np.testing.assert_allclose(found.scales[part], full.scales[part][some], rtol=1e-14)


def test_a_shape_that_comes_leaves_the_rows_of_the_others():
    references = np.arange(0, len(POINTS), 2)
    full = statistics({part: ALL[part][:, references] for part in PARTS}, references)
    fewer = statistics({part: ALL[part][:-1, references] for part in PARTS}, references)
    for part in PARTS:
        np.testing.assert_array_equal(fewer.scales[part], full.scales[part][:-1])


def test_the_order_of_the_shapes_does_not_matter():
    order = np.random.default_rng(5).permutation(len(POINTS))
    shuffled = {part: ALL[part][np.ix_(order, order)] for part in PARTS}
    F = fused_matrix(ALL)
    np.testing.assert_allclose(fused_matrix(shuffled), F[np.ix_(order, order)], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(
        reranked_matrix(fused_matrix(shuffled)), reranked_matrix(F)[np.ix_(order, order)], rtol=1e-9, atol=1e-12
    )


def test_copies_and_single_shapes():
    same = {part: np.zeros((3, 3)) for part in PARTS}
    np.testing.assert_array_equal(fused_matrix(same), 0.0)
    assert np.isfinite(reranked_matrix(fused_matrix(same))).all()
    one = {part: np.zeros((1, 1)) for part in PARTS}
    assert fused_matrix(one).tolist() == [[0.0]]
    assert reranked_matrix(fused_matrix(one)).tolist() == [[0.0]]
    none = {part: np.zeros((0, 0)) for part in PARTS}
    assert reranked_matrix(fused_matrix(none)).shape == (0, 0)


def test_one_query_is_re_ranked_as_all_are():
    F = fused_matrix(ALL)
    R = reranked_matrix(F)
    for i in (0, 7, 30):
        np.testing.assert_allclose(rerank(F, i), R[i], rtol=1e-9, atol=1e-12)


def test_a_chain_is_followed():
    # A curve bent back: its ends are near each other in space, and along it far apart.
    angle = np.linspace(0.0, 1.6 * np.pi, 60)
    curve = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    F = fused_matrix({part: np.linalg.norm(curve[:, None] - curve[None], axis=2) for part in PARTS})
    assert F[0, 59] < F[0, 20]
    R = reranked_matrix(F)
    assert R[0, 20] < R[0, 59]


@pytest.mark.parametrize("size", [2, 3, 5, 20])
def test_neither_few_relatives_nor_many_are_lost(size):
    D = distances(clusters(60 // size, size, 0.15), seed=size)
    label = np.repeat(np.arange(60 // size), size)
    R = reranked_matrix(fused_matrix(D))
    before = precision(fused_matrix(D), label)
    assert before < 1.0
    assert precision(R, label) >= before
    assert (R >= 0).all()
    assert np.isfinite(R).all()


def precision(D: np.ndarray, label: np.ndarray) -> float:
    """Share of relatives among as many of the nearest as a shape has relatives."""
    size = np.bincount(label)[0]
    near = np.argsort(D + np.diag(np.full(len(D), np.inf)), axis=1)[:, : size - 1]
    return float((label[near] == label[:, None]).mean())


def test_within_a_tight_class_a_near_copy_is_first():
    """The walk cannot tell apart what is far nearer than its scale; the distances still can."""
    random = np.random.default_rng(3)
    points = clusters(spread=0.02)
    copies = points + 1e-3 * random.normal(size=points.shape)
    for i in range(0, len(points), 5):
        one = np.concatenate([points, copies[i : i + 1]])
        F = np.linalg.norm(one[:, None] - one[None], axis=2)
        assert np.argsort(reranked_matrix(F)[-1], kind="stable")[1] == i
        assert np.argsort(rerank(F, len(points)), kind="stable")[1] == i


def test_what_cannot_be_ranked_is_refused():
    with pytest.raises(ParameterError, match=f"no {PARTS[1]}"):
        fused_matrix({PARTS[0]: ALL[PARTS[0]]})
    with pytest.raises(ParameterError, match=r"\(32, 32\).*\(31, 32\)"):
        fused_matrix({**ALL, PARTS[1]: ALL[PARTS[1]][1:]})
    with pytest.raises(ParameterError, match="shape"):
        rerank(np.zeros((3, 4)), 0)
