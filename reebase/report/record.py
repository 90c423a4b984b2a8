"""What a report is about: evaluations side by side, with what each descriptor costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from reebase.errors import ParameterError
from reebase.evaluation import Evaluation

__all__ = ["Cost", "Entry", "Report"]


@dataclass(frozen=True)
class Cost:
    """What a descriptor costs, medians over the shapes.

    milliseconds: wall time a mesh, beyond what all descriptors share. bytes: a shape, as float32.
    """

    milliseconds: float
    bytes: float


@dataclass(frozen=True, eq=False)
class Entry:
    """One way to rank, and how well it does. name: once in a report. measure: of a descriptor, how it was compared."""

    name: str
    measure: str | None
    evaluation: Evaluation
    summary: str = ""
    cost: Cost | None = None


@dataclass(frozen=True, eq=False)
class Report:
    """Evaluations of the same set by several descriptors.

    facts: what a reader must know of how it was made, by name. shared: what all descriptors share -> milliseconds a
    mesh. failed: shapes that were left out -> code and reason. names: id -> how a shape is called, where that is not
    its id. thumbnails: id -> PNG; ``lists.shown_in`` says of which shapes. Raises ParameterError when two entries have
    one name, or there is none.
    """

    title: str
    entries: Sequence[Entry]
    facts: Mapping[str, str] = field(default_factory=dict)
    shared: Mapping[str, float] = field(default_factory=dict)
    failed: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    names: Mapping[str, str] = field(default_factory=dict)
    thumbnails: Mapping[str, bytes] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.entries:
            raise ParameterError("A report needs at least one evaluation; found none.", parameter="entries")
        names = [entry.name for entry in self.entries]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ParameterError(
                f"Every evaluation of a report needs a name of its own; found {', '.join(twice)} more than once.",
                parameter="entries",
            )

    def name_of(self, shape: str) -> str:
        """How the shape of that id is called."""
        return self.names.get(shape, shape)

    def to_json(self, matrix: bool = False) -> dict[str, Any]:
        """A JSON-serialisable record: facts, costs, and each evaluation; with the matrices if asked for."""
        return {
            "title": self.title,
            "facts": dict(self.facts),
            "shared_milliseconds": dict(self.shared),
            "failed": {name: {"code": code, "detail": detail} for name, (code, detail) in self.failed.items()},
            "descriptors": {
                entry.name: {
                    "measure": entry.measure,
                    "cost": None if entry.cost is None else vars(entry.cost),
                    **entry.evaluation.to_json(matrix=matrix),
                }
                for entry in self.entries
            },
        }
