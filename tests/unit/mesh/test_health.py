from __future__ import annotations

import json

import pytest

from reebase.mesh.clean import clean
from reebase.mesh.health import FLAGS, Health
from tests.shapes import cube, grid, joined, soup


def report() -> Health:
    return clean(joined(soup(cube()), grid(2, 2)))[1]


def test_json_and_back_is_the_same_report() -> None:
    health = report()
    assert Health.from_json(json.loads(json.dumps(health.to_json()))) == health


def test_json_explains_each_flag() -> None:
    record = report().to_json()
    assert record["flags"] == ["open_surface", "several_components"]
    assert record["explanations"] == {name: FLAGS[name] for name in record["flags"]}


def test_flags_are_added_once_and_sorted() -> None:
    health = report().flagged("near_degenerate_eigenvalues", "open_surface")
    assert health.flags == ("near_degenerate_eigenvalues", "open_surface", "several_components")
    assert report().flags == ("open_surface", "several_components")


def test_a_flag_without_an_explanation_is_refused() -> None:
    with pytest.raises(KeyError):
        report().flagged("haunted")
