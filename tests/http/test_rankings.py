"""Rankings over HTTP are the library's, to the bit; who lacks a descriptor is told apart, and gets it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import httpx
import numpy as np
import pytest
from sqlalchemy import delete

from reebase.descriptors import DESCRIPTORS, descriptor_named, kept, surface_of
from reebase.matching import dissimilarity
from reebase.mesh import Mesh
from reebase.mesh.write import to_bytes
from reebase.pipeline import Profile, describe
from reebase.ranking import FUSED, PARTS, Ranking, ranking_named
from store import descriptors, results, tables
from tests.http.serving import Served
from tests.http.test_main_job import ended, indexed, uploaded
from tests.http.test_problems import is_problem
from tests.shapes import capsule, moved, torus

BANDS = 32


def thinner(mesh: Mesh, share: float) -> Mesh:
    z = mesh.vertices[:, 2:]
    x = 1 - share * (z - z.min()) / np.ptp(z)
    return Mesh(mesh.vertices * np.hstack([x, 1.2 * x, np.ones_like(x)]), mesh.faces)


MESHES = {
    **{f"capsule {length:g}": thinner(capsule(length=length), 0.3 + 0.05 * length) for length in (2.0, 3.0, 4.0, 6.0)},
    **{f"ring {width:g}": thinner(torus(1.0, width, 28, 14), 0.2) for width in (0.25, 0.3, 0.4)},
}


@pytest.fixture(scope="module")
def shelf(http: httpx.Client) -> dict[str, str]:
    """A collection of capsules and rings; name -> id, "" -> its path."""
    path = "/v1/collections/shelf"
    http.post("/v1/collections", json={"name": "shelf", "profile": {"bands": BANDS}}).raise_for_status()
    found = {
        name: uploaded(http, path, mesh, name=name, label=name.split()[0]) for name, mesh in MESHES.items()
    }
    for shape in found.values():
        indexed(http, shape)
    return {"": path, **{name: shape.rsplit("/", 1)[-1] for name, shape in found.items()}}


@pytest.fixture(scope="module")
def library(service: Served, shelf: dict[str, str]) -> dict[str, list[np.ndarray]]:
    """What is kept of the meshes: descriptor -> of each of them."""
    ids = [shelf[name] for name in MESHES]
    database = service.database()
    with database.read() as conn:
        key = Profile(bands=BANDS).key
        stored = descriptors.of_shapes(conn, ids, DESCRIPTORS, key)
        out = {name: [stored[id][name].values for id in ids] for name in stored[ids[0]]}
        out["srg"] = [results.features(conn, id).features for id in ids]
    database.close()
    return out


def test_what_is_kept_is_what_the_library_keeps(library: dict[str, list[np.ndarray]]) -> None:
    for place, mesh in enumerate(MESHES.values()):
        described = describe(to_bytes(mesh, "ply"), Profile(bands=BANDS))
        expected, refused = kept.keep(surface_of(described), [name for name in library if name != "srg"])
        assert refused == {}
        for name, one in expected.items():
            np.testing.assert_allclose(library[name][place], one.values, rtol=1e-4, atol=1e-5, err_msg=name)
        np.testing.assert_allclose(library["srg"][place], described.features, rtol=1e-8)


def asked(ranking: Ranking) -> dict[str, Any]:
    found: dict[str, Any] = {"descriptor": ranking.name, "measure": ranking.measure}
    return {**{name: value for name, value in found.items() if value}, "rerank": ranking.rerank}


RANKINGS = [
    *(ranking_named(FUSED, rerank=again) for again in (True, False)),
    *(ranking_named(name) for name in ("srg", "extended", "hks", "views", "d2")),
    ranking_named("hks", "l2"), ranking_named("srg", "greedy"),
]  # fmt: skip


@pytest.mark.parametrize("ranking", RANKINGS, ids=str)
def test_the_service_ranks_as_the_library(
    http: httpx.Client, shelf: dict[str, str], library: dict[str, list[np.ndarray]], ranking: Ranking
) -> None:
    matrix = ranking.matrix(library)
    names = list(MESHES)
    for row, name in enumerate(names):
        body = {"shape": shelf[name], "k": 10, "tolerance": None, **asked(ranking)}
        answer = http.post(f"{shelf['']}/query", json=body).json()
        assert answer["left_out"] == []
        assert (answer["query"]["descriptor"], answer["query"]["measure"]) == (ranking.name, ranking.measure)
        assert answer["query"]["rerank"] is ranking.rerank
        served = {hit["shape"]["name"]: hit["dissimilarity"] for hit in answer["hits"]}
        expected = {other: matrix[row, column] for column, other in enumerate(names) if other != name}
        assert served == pytest.approx(expected, rel=1e-9 if ranking.rerank else 1e-15, abs=1e-12)
        assert list(served.values()) == sorted(served.values())
        for hit in answer["hits"]:
            column = names.index(hit["shape"]["name"])
            measure = ranking.measure if ranking.name == "srg" else "matching"
            D = dissimilarity(library["srg"][row], library["srg"][column], measure or "matching")
            assert hit["graph_dissimilarity"] == pytest.approx(D, rel=1e-12)
            assert [part["descriptor"] for part in hit["parts"]] == list(ranking.parts)
            assert sum(part["share"] for part in hit["parts"]) == pytest.approx(1.0)
            for part in hit["parts"]:
                named = descriptor_named(part["descriptor"])
                pair = [np.float64(library[named.name][place]) for place in (row, column)]
                assert part["dissimilarity"] == pytest.approx(named.compare(*pair, part["measure"]), rel=1e-12)


@pytest.mark.parametrize("ranking", [RANKINGS[0], *RANKINGS[3:6]], ids=str)
def test_an_evaluation_is_of_the_same_matrix(
    http: httpx.Client, shelf: dict[str, str], library: dict[str, list[np.ndarray]], ranking: Ranking
) -> None:
    body = {"collection": "shelf", "bootstrap": 20, **asked(ranking)}
    started = http.post("/v1/evaluations", json=body).json()
    assert started["request"]["rerank"] is ranking.rerank
    assert ended(http, started["task"]["id"])["state"] == "succeeded"
    report = http.get(f"/v1/evaluations/{started['id']}").json()["report"]
    assert (report["descriptor"], report["measure"], report["rerank"]) == (
        ranking.name, ranking.measure, ranking.rerank,
    )  # fmt: skip
    assert report["parts"] == dict(ranking.parts)
    assert (report["lacking"], report["failed"]) == ([], [])
    assert set(report["intervals"]) >= {"nn", "map"}
    found = http.get(f"/v1/evaluations/{started['id']}/matrix").json()
    assert [item["name"] for item in found["items"]] == list(MESHES)
    np.testing.assert_allclose(found["matrix"], ranking.matrix(library), rtol=1e-12, atol=1e-12)


def test_the_synthetic_set_is_evaluated_by_all_fused(http: httpx.Client) -> None:
    synthetic = {"per_class": 2, "classes": ["snakes", "octopuses"]}
    started = http.post("/v1/evaluations", json={"synthetic": synthetic, "descriptor": FUSED, "bootstrap": 0}).json()
    assert ended(http, started["task"]["id"])["state"] == "succeeded"
    assert http.get(f"/v1/evaluations/{started['id']}").json()["report"]["overall"]["nn"] == 1.0


def test_endpoints_that_are_matched_lie_where_the_answer_says(http: httpx.Client, shelf: dict[str, str]) -> None:
    from reebase.mesh.read import read

    by_shape = http.post(f"{shelf['']}/query", json={"shape": shelf["capsule 2"], "descriptor": "extended"}).json()
    data = to_bytes(MESHES["capsule 2"], "ply")
    by_mesh = http.post(f"{shelf['']}/query", content=data, params={"descriptor": "extended"}).json()
    assert by_mesh["hits"][0]["dissimilarity"] == 0.0
    assert by_mesh["query"]["positions"] == by_shape["query"]["positions"]
    own = read(http.get(f"{shelf['']}/shapes/{shelf['capsule 2']}/mesh").content, "ply").vertices
    places = np.array(by_shape["query"]["positions"]["extended"])
    assert np.abs(own[None] - places[:, None]).sum(axis=2).min(axis=1).max() < 1e-5
    for hit in by_shape["hits"]:
        (part,) = hit["parts"]
        matched = part["matched"]
        used = [pair["query"] for pair in matched["pairs"]] + [one["endpoint"] for one in matched["unmatched_query"]]
        assert sorted(used) == list(range(len(places)))
        used = [pair["hit"] for pair in matched["pairs"]] + [one["endpoint"] for one in matched["unmatched_hit"]]
        assert sorted(used) == list(range(len(matched["positions"])))


def test_a_copy_ranks_as_the_shape_itself(http: httpx.Client, shelf: dict[str, str]) -> None:
    by_shape = http.post(f"{shelf['']}/query", json={"shape": shelf["ring 0.3"]}).json()
    by_mesh = http.post(f"{shelf['']}/query", content=to_bytes(MESHES["ring 0.3"], "ply")).json()
    assert by_shape["query"]["descriptor"] == FUSED
    assert by_mesh["hits"][0]["shape"]["name"] == "ring 0.3"
    rest = [(hit["shape"]["id"], hit["dissimilarity"]) for hit in by_mesh["hits"][1:]]
    assert rest == [(hit["shape"]["id"], hit["dissimilarity"]) for hit in by_shape["hits"]]


def test_filters_do_not_change_what_a_hit_is(http: httpx.Client, shelf: dict[str, str]) -> None:
    body = {"shape": shelf["capsule 2"], "k": 10}
    every = {hit["shape"]["id"]: hit for hit in http.post(f"{shelf['']}/query", json=body).json()["hits"]}
    for more in ({"label": "ring"}, {"k": 2}, {"tolerance": 0}, {"max_dissimilarity": 3.0}):
        answer = http.post(f"{shelf['']}/query", json={**body, **more}).json()
        for hit in answer["hits"]:
            assert {**every[hit["shape"]["id"]], "rank": hit["rank"]} == hit
    rings = http.post(f"{shelf['']}/query", json={**body, "label": "ring"}).json()
    assert {hit["shape"]["label"] for hit in rings["hits"]} == {"ring"}
    assert rings["considered"] == 3


def test_what_is_known_of_descriptors(http: httpx.Client, shelf: dict[str, str]) -> None:
    found = http.get("/v1/descriptors").json()
    items = {item["name"]: item for item in found["items"]}
    assert found["default"] == FUSED
    assert list(items) == [FUSED, *DESCRIPTORS]
    assert items[FUSED]["parts"] == list(PARTS) and items[FUSED]["rerank"] and items[FUSED]["kept"]
    assert items["srg"]["measures"][0] == "matching" and items["srg"]["explained"]
    assert not items["hks"]["explained"] and not items["hks"]["rerank"] and not items["patches"]["kept"]
    coverage = http.get(f"{shelf['']}/descriptors").json()
    assert coverage["described"] == len(MESHES)
    counts = {item["name"]: (item["shapes"], item["lacking"]) for item in coverage["items"]}
    assert counts["extended"] == counts["srg"] == (len(MESHES), 0)


@pytest.fixture
def older(http: httpx.Client, service: Served) -> Iterator[dict[str, str]]:
    """A collection of which one shape was described before anything but the endpoint features was kept."""
    path = "/v1/collections/older"
    http.post("/v1/collections", json={"name": "older", "profile": {"bands": BANDS}}).raise_for_status()
    chosen = [name for name in MESHES if name.startswith("capsule")]
    found = {name: uploaded(http, path, MESHES[name], name=name, label="capsule") for name in chosen}
    ids = {name: indexed(http, shape)["id"] for name, shape in found.items()}
    database = service.database()
    with database.write() as conn:
        conn.execute(delete(tables.descriptor).where(tables.descriptor.c.shape_id == ids["capsule 3"]))
        conn.execute(tables.endpoint_features.update().values(revision=tables.endpoint_features.c.revision))
    database.close()
    yield {"": path, **ids}
    http.delete(path).raise_for_status()


def test_shapes_that_lack_a_descriptor_are_told_apart_and_get_it(http: httpx.Client, older: dict[str, str]) -> None:
    path = older[""]
    answer = http.post(f"{path}/query", json={"shape": older["capsule 2"]}).json()
    assert {hit["shape"]["name"] for hit in answer["hits"]} == {"capsule 4", "capsule 6"}
    (left_out,) = answer["left_out"]
    assert (left_out["code"], left_out["shapes"]) == ("without_descriptor", 1)
    assert "reindex" in left_out["detail"]
    by_d = http.post(f"{path}/query", json={"shape": older["capsule 3"], "descriptor": "srg"}).json()
    assert len(by_d["hits"]) == 3
    value = is_problem(http.post(f"{path}/query", json={"shape": older["capsule 3"]}), 404, "result_not_found")
    assert value["details"]["descriptors"] == list(PARTS)
    items = {item["name"]: item for item in http.get(f"{path}/descriptors").json()["items"]}
    assert (items["hks"]["shapes"], items["hks"]["lacking"]) == (3, 1)
    started = http.post("/v1/evaluations", json={"collection": "older", "descriptor": FUSED, "bootstrap": 0}).json()
    ended(http, started["task"]["id"])
    assert http.get(f"/v1/evaluations/{started['id']}").json()["report"]["lacking"] == ["capsule 3"]

    reply = http.post(f"{path}/reindex")
    assert (reply.status_code, reply.json()) == (202, {"queued": 1})
    indexed(http, f"{path}/shapes/{older['capsule 3']}")
    assert http.post(f"{path}/reindex").json() == {"queued": 0}
    again = http.post(f"{path}/query", json={"shape": older["capsule 3"]}).json()
    assert (len(again["hits"]), again["left_out"]) == (3, [])


def test_a_costly_descriptor_is_given_on_demand_and_stays(http: httpx.Client, older: dict[str, str]) -> None:
    path = older[""]
    problem = http.post("/v1/evaluations", json={"collection": "older", "descriptor": "patches"})
    value = is_problem(problem, 409, "nothing_to_compare")
    assert value["details"]["descriptors"] == ["patches"] and "Reindex" in value["detail"]
    nothing = http.post(f"{path}/query", content=to_bytes(MESHES["ring 0.3"], "ply"), params={"descriptor": "patches"})
    assert (nothing.json()["hits"], nothing.json()["left_out"][0]["shapes"]) == ([], 4)
    assert http.post(f"{path}/reindex", json={"descriptors": ["patches"]}).json() == {"queued": 4}
    for name, shape in older.items():
        if name:
            indexed(http, f"{path}/shapes/{shape}")
    found = http.post(f"{path}/query", json={"shape": older["capsule 2"], "descriptor": "patches"}).json()
    assert len(found["hits"]) == 3
    # Another profile describes all anew, with what they had.
    http.patch(path, json={"profile": {"bands": BANDS + 1}}).raise_for_status()
    for name, shape in older.items():
        if name:
            indexed(http, f"{path}/shapes/{shape}")
    items = {item["name"]: item for item in http.get(f"{path}/descriptors").json()["items"]}
    assert (items["patches"]["shapes"], items["patches"]["lacking"]) == (4, 0)
    is_problem(http.post(f"{path}/reindex", json={"descriptors": ["best"]}), 422, "unknown_name")


def test_a_deleted_shape_leaves_the_ranking_and_comes_back(http: httpx.Client, older: dict[str, str]) -> None:
    path, asked_of = older[""], older["capsule 2"]

    def names() -> set[str]:
        answer = http.post(f"{path}/query", json={"shape": asked_of, "descriptor": "hks"}).json()
        return {hit["shape"]["name"] for hit in answer["hits"]}

    assert names() == {"capsule 4", "capsule 6"}
    http.delete(f"{path}/shapes/{older['capsule 4']}").raise_for_status()
    assert names() == {"capsule 6"}
    http.post(f"{path}/bulk/restore", json={"shapes": [older["capsule 4"]]}).raise_for_status()
    assert names() == {"capsule 4", "capsule 6"}


WRONG = {
    "an unknown descriptor": ({"descriptor": "best"}, "unknown_name"),
    "a measure of another": ({"descriptor": "hks", "measure": "matching"}, "unknown_name"),
    "a measure of fused": ({"descriptor": "fused", "measure": "l1"}, "invalid_parameter"),
    "a single one re-ranked": ({"descriptor": "extended", "rerank": True}, "invalid_parameter"),
    "rerank that is no boolean": ({"rerank": "perhaps"}, "validation_error"),
}


@pytest.mark.parametrize(("wrong", "code"), WRONG.values(), ids=WRONG)
def test_rankings_that_are_not_there(
    http: httpx.Client, shelf: dict[str, str], wrong: dict[str, Any], code: str
) -> None:
    is_problem(http.post(f"{shelf['']}/query", json={"shape": shelf["ring 0.3"], **wrong}), 422, code)
    data = to_bytes(MESHES["ring 0.3"], "ply")
    is_problem(http.post(f"{shelf['']}/query", files={"file": ("a.ply", data)}, data=wrong), 422, code)
    if code != "validation_error":
        is_problem(http.post("/v1/evaluations", json={"collection": "shelf", **wrong}), 422, code)


def test_a_moved_copy_is_found_first(http: httpx.Client, shelf: dict[str, str]) -> None:
    turned = moved(MESHES["capsule 4"], (5, 5, 5), scale=3.0, seed=2)
    for again in ("true", "false"):
        reply = http.post(f"{shelf['']}/query", content=to_bytes(turned, "ply"), params={"rerank": again})
        hits = reply.json()["hits"]
        assert {hit["shape"]["label"] for hit in hits[:4]} == {"capsule"}
    assert hits[0]["shape"]["name"] == "capsule 4"
