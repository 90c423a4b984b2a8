"""What a denoising filter is: a name, its parameters, and a step from positions to displacements."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError
from reebase.mesh.topology import Rings

__all__ = ["Choice", "Filter", "Hold", "Number", "Report", "Ruled", "Step", "Surface", "stepped"]

FloatArray = npt.NDArray[np.float64]

Step = Callable[[FloatArray], FloatArray]
"""From positions, (m, 3), to the displacement of each vertex, (m, 3), zero for isolated vertices."""

Hold = Callable[[FloatArray, FloatArray], FloatArray]
"""From positions and displacements to what the boundary allows of the displacements, all (m, 3)."""


def free(_: FloatArray, displacements: FloatArray) -> FloatArray:
    """Allows everything."""
    return displacements


class Report:
    """Tells a listener which share of the work is done, in [0, 1]: so many iterations, and a share of one."""

    def __init__(self, listener: Callable[[float], None] | None = None, iterations: int = 1) -> None:
        self._listener = listener
        self._iterations = iterations
        self._done = 0

    def within(self, share: float) -> None:
        """A share of the present iteration is done."""
        if self._listener is not None:
            self._listener((self._done + share) / self._iterations)

    def part(self, low: float, high: float) -> Report:
        """One for what takes the present iteration from a share to another."""
        return Report(lambda share: self.within(low + (high - low) * share))

    def another(self) -> None:
        """The present iteration is done."""
        self._done += 1
        self.within(0.0)


@dataclass(frozen=True, eq=False)
class Surface:
    """What a filter is prepared with; lengths are in mean edge lengths of the mesh that came in.

    positions: (m, 3), where the vertices are before the first step. faces: int32, (n, 3). rings: built once.
    unit: that mean edge length in the mesh's own units, for what is printed in raw units. hold: for steps made
    of several moves, each of which has to respect the boundary; ``stepped`` applies it to whole steps. held: whether
    there is a boundary that it holds. known: what was found of the faces alone, by name, for filters that follow one
    another. report: told of iterations that are done, and by long ones of shares of themselves.
    """

    positions: FloatArray
    faces: npt.NDArray[np.int32]
    rings: Rings
    unit: float = 1.0
    hold: Hold = free
    held: bool = False
    known: dict[str, Any] = field(default_factory=dict)
    report: Report = field(default_factory=Report)


Run = Callable[[Surface, Mapping[str, Any], int], FloatArray]


@dataclass(frozen=True)
class Number:
    """A real parameter in [low, high], or (low, high] when ``above_low``; an integer when ``whole``."""

    default: float
    low: float
    high: float
    meaning: str
    above_low: bool = False
    whole: bool = False

    def check(self, name: str, value: Any) -> float:
        """The value as a float, or an int when ``whole``. Raises ParameterError."""
        kinds = (int, np.integer) if self.whole else (int, float, np.integer, np.floating)
        number = isinstance(value, kinds) and not isinstance(value, bool)
        # A comparison with NaN is false, so that NaN is refused as well.
        if not number or not (self.low <= value <= self.high) or (self.above_low and value == self.low):
            interval = f"{'(' if self.above_low else '['}{self.low:g}, {self.high:g}]"
            raise ParameterError(
                f"{name} must be a {'whole ' if self.whole else ''}number in {interval}; found {value!r}.",
                parameter=name, found=repr(value),
            )  # fmt: skip
        return int(value) if self.whole else float(value)


@dataclass(frozen=True)
class Choice:
    """A parameter with one of a few values."""

    default: str | bool | int
    options: tuple[str | bool | int, ...]
    meaning: str

    def check(self, name: str, value: Any) -> str | bool | int:
        """The value. Raises ParameterError."""
        for option in self.options:
            if type(option) is type(value) and option == value:
                return option
        raise ParameterError(
            f"{name} must be one of {', '.join(map(repr, self.options))}; found {value!r}.",
            parameter=name, found=repr(value),
        )  # fmt: skip


@dataclass(frozen=True)
class Ruled:
    """A real parameter in a ``Number``'s interval, or the name of the rule that finds it from the mesh.

    ruled: whether the default is the rule, and not the number's.
    """

    rule: str
    number: Number
    meaning: str
    ruled: bool = True

    @property
    def default(self) -> str | float:
        """The rule, or the number's default."""
        return self.rule if self.ruled else self.number.default

    def check(self, name: str, value: Any) -> str | float:
        """The rule, or the value as a float. Raises ParameterError."""
        if isinstance(value, str):
            return str(Choice(self.rule, (self.rule,), self.meaning).check(name, value))
        return self.number.check(name, value)


@dataclass(frozen=True)
class Filter:
    """A denoising filter.

    prepare: called once with the surface and checked parameters; returns the step that every iteration takes.
    run: positions after so many iterations, equal to ``stepped``, where that can be faster.
    """

    name: str
    summary: str
    prepare: Callable[[Surface, Mapping[str, Any]], Step]
    parameters: Mapping[str, Number | Choice | Ruled] = field(default_factory=dict)
    run: Run | None = None

    def checked(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Every parameter by name, the given ones checked and the others at their defaults. Raises
        ParameterError."""
        for name in given:
            if name not in self.parameters:
                known = ", ".join(sorted(self.parameters)) or "none"
                raise ParameterError(
                    f"The filter {self.name} has no parameter {name!r}; its parameters: {known}.",
                    parameter=name, choices=sorted(self.parameters),
                )  # fmt: skip
        return {
            name: parameter.check(name, given.get(name, parameter.default))
            for name, parameter in self.parameters.items()
        }


def stepped(surface: Surface, step: Step, iterations: int) -> FloatArray:
    """The positions, (m, 3), after so many steps, each held at the boundary."""
    positions = surface.positions
    for _ in range(iterations):
        positions = positions + surface.hold(positions, step(positions))
        surface.report.another()
    return positions
