"""The ten figures by the name of their class: each draws one posed instance from a random generator."""

from __future__ import annotations

from collections.abc import Callable

from reebase.evaluation.synthetic.figures.arthropods import ant, crab, spider
from reebase.evaluation.synthetic.figures.people import hand, human, teddy_bear
from reebase.evaluation.synthetic.figures.posing import Random
from reebase.evaluation.synthetic.figures.soft_bodies import octopus, snake
from reebase.evaluation.synthetic.figures.tools import pliers, spectacles
from reebase.evaluation.synthetic.implicit import Figure

__all__ = ["FIGURES"]

FIGURES: dict[str, Callable[[Random], Figure]] = {
    "ants": ant,
    "crabs": crab,
    "hands": hand,
    "humans": human,
    "octopuses": octopus,
    "pliers": pliers,
    "snakes": snake,
    "spectacles": spectacles,
    "spiders": spider,
    "teddy-bears": teddy_bear,
}
