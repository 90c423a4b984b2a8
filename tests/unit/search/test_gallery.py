"""A gallery ranks as the matrix of all pairs does, whatever way it came to hold what it holds."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from reebase.descriptors import DESCRIPTORS
from reebase.errors import ParameterError, UnknownName
from reebase.matching import MEASURES
from reebase.ranking import FUSED, PARTS, RANKINGS, ranking_named
from reebase.search import Gallery, gallery

RANDOM = np.random.default_rng(0)


def drawn(name: str, centre: float) -> np.ndarray:
    """Something like what the descriptor keeps, near other shapes with the same centre."""
    if name in ("srg", "rgpd"):
        return np.abs(centre + 0.1 * RANDOM.random((RANDOM.integers(2, 6), 3)))
    if DESCRIPTORS[name].comparison.explain is not None:
        count = RANDOM.integers(2, 6)
        return np.column_stack([centre + 0.1 * RANDOM.normal(size=(count, 4)), RANDOM.uniform(0.2, 1.0, count)])
    return centre + 0.1 * RANDOM.normal(size=(36, 100) if name == "views" else 12)


def shapes(ranking, count: int) -> dict[str, dict[str, np.ndarray]]:
    """id -> part -> what is kept, in single precision."""
    return {
        f"{number:03d}": {part: np.float32(drawn(part, number % 4)) for part in ranking.parts}
        for number in range(count)
    }


def filled(ranking, kept) -> Gallery:
    return Gallery(ranking).changed(kept)


SIMPLE = [ranking_named(name, measure) for name in ("extended", "hks", "srg") for measure in DESCRIPTORS[name].measures]
FUSIONS = [ranking_named(FUSED, rerank=again) for again in (False, True)]


@pytest.mark.parametrize("ranking", [*SIMPLE, *FUSIONS], ids=str)
def test_a_shape_ranks_all_as_its_row_of_the_matrix(ranking):
    kept = shapes(ranking, 14)
    held = filled(ranking, kept)
    matrix = ranking.matrix({part: [one[part] for one in kept.values()] for part in ranking.parts})
    for row, (id, own) in enumerate(kept.items()):
        found = held.rank(own, id, again=ranking.rerank)
        np.testing.assert_allclose(found.dissimilarities, matrix[row], atol=1e-9 if ranking.rerank else 0, rtol=0)
        np.testing.assert_allclose(sum(found.shares.values()), 1.0)
        if all((found.distances[part] == 0).sum() == 1 for part in ranking.parts):
            copy = held.rank(own, again=ranking.rerank)
            np.testing.assert_array_equal(copy.dissimilarities, found.dissimilarities)


@pytest.mark.parametrize("ranking", [SIMPLE[0], *FUSIONS], ids=str)
def test_what_comes_and_goes_leaves_the_same_as_a_gallery_made_at_once(ranking):
    kept = shapes(ranking, 20)
    ids = list(kept)
    held = filled(ranking, {id: kept[id] for id in ids[3:12]})
    held.rank(kept["000"])
    some = {id: kept[id] for id in ids[:7]}
    held = held.changed(some, ["010", "not there"])
    held = held.changed({id: kept[id] for id in ids[12:]})
    held.rank(kept["001"], "001")
    held = held.changed({}, ["004", "013"])
    left = {id: one for id, one in kept.items() if id not in ("004", "010", "013")}
    once = filled(ranking, left)
    assert held.ids == once.ids == tuple(sorted(left))
    for id in (None, "001", "019"):
        found, expected = (one.rank(kept["001"], id, again=ranking.rerank) for one in (held, once))
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_equal(one, other)


@pytest.mark.parametrize("ranking", FUSIONS, ids=str)
def test_a_query_from_outside_ranks_as_if_it_stood_outside(ranking):
    kept = shapes(ranking, 16)
    outside = kept.pop("005")
    found = filled(ranking, kept).rank(outside, again=ranking.rerank)
    same = [number % 4 == 1 for number in range(16) if number != 5]
    assert found.dissimilarities[same].max() < found.dissimilarities[~np.array(same)].min()
    assert (found.dissimilarities >= 0).all()


@pytest.mark.parametrize("ranking", FUSIONS, ids=str)
def test_a_large_collection_is_ranked_through_references_and_candidates(ranking, monkeypatch):
    kept = shapes(ranking, 40)
    small = filled(ranking, kept).rank(kept["022"], "022", again=ranking.rerank)
    monkeypatch.setattr(gallery, "REFERENCES", 12)
    monkeypatch.setattr(gallery, "CANDIDATES", 15)
    held = filled(ranking, kept)
    order = np.argsort(held.rank(kept["022"], "022", again=ranking.rerank).dissimilarities, kind="stable")
    # The class is ten shapes of 40; all of it comes first, as it does without a limit.
    assert {int(place) % 4 for place in order[:10]} == {2}
    assert {int(place) % 4 for place in np.argsort(small.dissimilarities)[:10]} == {2}
    # What comes later adds rows to the references, and leaves the others as they are.
    later = held.changed({"100": kept["022"]})
    once = filled(ranking, {**kept, "100": kept["022"]})
    found, expected = (one.rank(kept["022"], "022", again=ranking.rerank) for one in (later, once))
    np.testing.assert_array_equal(found.dissimilarities, expected.dissimilarities)


@pytest.mark.parametrize("ranking", FUSIONS, ids=str)
def test_a_query_of_a_large_collection_measures_its_candidates_alone(ranking, monkeypatch):
    kept = shapes(ranking, 60)
    monkeypatch.setattr(gallery, "REFERENCES", 12)
    monkeypatch.setattr(gallery, "CANDIDATES", 15)
    held = filled(ranking, kept)
    compared = []
    completed = Gallery._completed

    def counted(self, part, measure, places):
        compared.append(len(places))
        return completed(self, part, measure, places)

    monkeypatch.setattr(Gallery, "_completed", counted)
    found = held.rank(kept["022"], "022", again=ranking.rerank)
    assert compared == [15] * len(PARTS)
    again = held.rank(kept["022"], "022", again=ranking.rerank)
    assert compared == [15] * len(PARTS)
    np.testing.assert_array_equal(again.dissimilarities, found.dissimilarities)
    # What was asked before changes nothing, and neither does what came and went.
    held.rank(kept["007"], "007", again=ranking.rerank)
    passed = held.changed({"100": kept["022"], "101": kept["003"]}).changed({"102": kept["001"]}, ["100", "101"])
    passed.rank(kept["007"], "007", again=ranking.rerank)
    back = passed.changed({}, ["102"])
    for id in ("022", "041"):
        fresh = filled(ranking, kept).rank(kept[id], id, again=ranking.rerank)
        for one in (held, back):
            for mine, other in zip(one.rank(kept[id], id, again=ranking.rerank), fresh, strict=True):
                np.testing.assert_equal(mine, other)
    # All are ranked; the first of those that are not candidates is as far as the last that is.
    assert len(np.unique(found.dissimilarities)) >= 59
    np.testing.assert_allclose(sum(found.shares.values()), 1.0)


def test_a_snapshot_made_while_another_is_measured_does_not_measure_it_all_again(monkeypatch):
    ranking = FUSIONS[0]
    kept = shapes(ranking, 30)
    ids = list(kept)
    first = filled(ranking, {id: kept[id] for id in ids[:25]})
    measuring, later_is_made, columns = threading.Event(), threading.Event(), []
    completed = Gallery._completed

    def slowly(self, part, measure, places):
        measuring.set()
        assert later_is_made.wait(10)
        columns.append(len({self.ids[place] for place in places} - set(self._known.ids)))
        return completed(self, part, measure, places)

    monkeypatch.setattr(Gallery, "_completed", slowly)
    thread = threading.Thread(target=first.rank, args=(kept["000"],))
    thread.start()
    assert measuring.wait(10)
    later = first.changed({id: kept[id] for id in ids[25:28]}).changed({ids[28]: kept[ids[28]]}, ["003"])
    later_is_made.set()
    found = later.rank(kept["001"], "001")
    thread.join()
    # 25 by the first, then only what came since.
    assert columns == [25] * len(PARTS) + [4] * len(PARTS)
    left = {id: one for id, one in list(kept.items())[:29] if id != "003"}
    np.testing.assert_array_equal(found.dissimilarities, filled(ranking, left).rank(kept["001"], "001").dissimilarities)


def test_the_memory_is_that_of_single_precision_and_of_distances_to_references(monkeypatch):
    ranking = FUSIONS[1]
    held = filled(ranking, shapes(ranking, 30))
    single = sum(kept.values.nbytes + kept.offsets.nbytes for kept in held._kept.values())
    assert held.bytes == single
    monkeypatch.setattr(gallery, "REFERENCES", 10)
    held.rank({part: drawn(part, 0) for part in PARTS})
    assert held.bytes == single + len(PARTS) * 30 * 10 * 8


@pytest.mark.parametrize("ranking", [SIMPLE[0], *FUSIONS], ids=str)
def test_of_no_shape_and_of_one(ranking):
    kept = shapes(ranking, 1)
    assert len(Gallery(ranking).rank(kept["000"], again=ranking.rerank).dissimilarities) == 0
    alone = filled(ranking, kept)
    assert alone.rank(kept["000"], "000", again=ranking.rerank).dissimilarities == pytest.approx([0.0], abs=1e-12)
    assert len(alone.rank({part: drawn(part, 1) for part in ranking.parts}).dissimilarities) == 1
    assert len(alone.changed({}, ["000"])) == 0


def test_names():
    assert set(RANKINGS) == {FUSED, *DESCRIPTORS}
    assert ranking_named("srg").parts == {"srg": "matching"}
    assert ranking_named("srg", "greedy").parts == {"srg": "greedy"}
    assert set(ranking_named(FUSED).parts) == set(PARTS)
    assert ranking_named(FUSED).rerank
    assert not ranking_named(FUSED, rerank=False).rerank
    assert set(MEASURES) == set(DESCRIPTORS["srg"].measures)
    with pytest.raises(UnknownName, match="fused"):
        ranking_named("best")
    with pytest.raises(UnknownName, match="greedy"):
        ranking_named("srg", "l1")
    with pytest.raises(ParameterError, match="measure"):
        ranking_named(FUSED, "l1")
    with pytest.raises(ParameterError, match="rerank"):
        ranking_named("hks", rerank=True)


def test_refuses_what_the_descriptors_did_not_make():
    with pytest.raises(ParameterError, match="hks"):
        Gallery(ranking_named("hks")).changed({"a": {"hks": np.array([np.nan])}})
