"""Each crash test has a house of its own, whose processes do not outlive it."""

from __future__ import annotations

import pytest

from tests.crash.house import House


@pytest.fixture
def build(tmp_path):
    """Makes a house with the settings given."""
    houses = []

    def make(**settings):
        houses.append(House(tmp_path, **settings))
        return houses[-1]

    yield make
    for house in houses:
        house.close()


@pytest.fixture
def house(build):
    """A house with the settings that most tests need."""
    return build()
