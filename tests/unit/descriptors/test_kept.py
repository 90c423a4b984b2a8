"""What is kept of a shape: nothing that could not be compared."""

from __future__ import annotations

import importlib
import io
from dataclasses import replace

import numpy as np
import pytest

from reebase.descriptors import Surface, descriptor_named, kept
from tests.shapes import icosphere


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1e60])
def test_a_descriptor_that_fails_is_refused_and_leaves_the_others(
    monkeypatch: pytest.MonkeyPatch, wrong: float
) -> None:
    """1e60 is finite, but not as it is stored."""
    broken = replace(descriptor_named("hks"), keep=lambda _: np.full(160, wrong))
    module = importlib.import_module("reebase.descriptors.kept")
    monkeypatch.setattr(module, "descriptor_named", lambda name: broken if name == "hks" else descriptor_named(name))
    with np.errstate(over="ignore"):
        found, refused = kept.keep(Surface(icosphere(3)), ["hks", "shape_dna"])
    assert (list(found), list(refused)) == (["shape_dna"], ["hks"])
    assert "not finite" in refused["hks"].message


def test_rows_that_its_own_comparison_refuses_are_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    broken = replace(descriptor_named("views"), keep=lambda _: np.zeros((3, 7)))
    monkeypatch.setattr(importlib.import_module("reebase.descriptors.kept"), "descriptor_named", lambda _: broken)
    found, refused = kept.keep(Surface(icosphere(3)), ["views"])
    assert (found, list(refused)) == ({}, ["views"])


def test_saved_and_loaded_it_is_the_same() -> None:
    found, _ = kept.keep(Surface(icosphere(3)), ["extended", "shape_dna"])
    file = io.BytesIO()
    kept.save(file, found)
    again = kept.load(io.BytesIO(file.getvalue()))
    assert list(again) == list(found)
    for name, one in found.items():
        assert np.array_equal(again[name].values, one.values)
        assert np.array_equal(again[name].places, one.places) if one.places is not None else again[name].places is None
