"""The health report: what was found in a mesh, what was repaired, what is unusual."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

__all__ = ["FLAGS", "Health"]

FLAGS: dict[str, str] = {
    "several_components": "The surface has several separate parts.",
    "joined_components": "The skeleton, and D with it, is of all parts, joined where they are nearest; further "
    "descriptors, and so the default ranking, see the largest part.",
    "largest_component_only": "The skeleton is that of the largest part by area; the others are left out.",
    "small_components_left_out": "The skeleton leaves out the smallest parts: past 20,000, or with hardly any area.",
    "open_surface": "The surface has a boundary; it is indexed as it is, with free (Neumann) boundaries.",
    "non_manifold": "Some edges have more than two faces, or faces disagree on their orientation.",
    "near_degenerate_eigenvalues": "The second and third eigenvalues are within 5 %: the shape is nearly symmetric and "
    "its skeleton may change when it is remeshed.",
    "no_endpoints": "The Reeb graph has no endpoint, so the shape matches only others without endpoints.",
    "single_node": "The Reeb graph is a single node: the scalar field is constant.",
    "no_path_lengths": "All distances from the root node are zero, so no features could be formed.",
    "tufted_operator": "Because of non-manifold edges or nearly degenerate triangles, the operator was built on the "
    "intrinsic Delaunay triangulation of the tufted cover.",
}
"""Every flag a health report can carry, in plain words for people."""


@dataclass(frozen=True)
class Health:
    """What cleaning found and did, and what later stages noticed.

    All counts are of the cleaned mesh unless named ``*_read``. Lengths are in the file's units.
    repairs: what was done -> how many times (``merged_vertices``, ``removed_degenerate_faces``, ...).
    flags: names from FLAGS, sorted.
    """

    vertices_read: int
    faces_read: int
    vertices: int
    faces: int
    edges: int
    components: int
    boundary_edges: int
    boundary_loops: int
    non_manifold_edges: int
    euler_characteristic: int
    genus: int | None  # of the whole surface, when it is closed, manifold and oriented
    closed: bool
    oriented: bool
    area: float
    volume: float | None  # signed volume when closed, else None
    mean_edge_length: float
    largest_component_share: float  # of the area, in (0, 1]
    non_manifold_vertices: int = 0  # where several fans of triangles touch; they are left as they are
    repairs: dict[str, int] = field(default_factory=dict)
    flags: tuple[str, ...] = ()

    def flagged(self, *names: str) -> Health:
        """The same report with more flags. Raises KeyError for a flag that FLAGS does not explain."""
        for name in names:
            FLAGS[name]
        return dataclasses.replace(self, flags=tuple(sorted({*self.flags, *names})))

    def to_json(self) -> dict[str, Any]:
        """A JSON-serialisable report; ``explanations`` gives each flag in words."""
        record = dataclasses.asdict(self)
        record["flags"] = list(self.flags)
        record["explanations"] = {name: FLAGS[name] for name in self.flags}
        return record

    @classmethod
    def from_json(cls, record: dict[str, Any]) -> Health:
        """The inverse of ``to_json``."""
        kept = {f.name: record[f.name] for f in dataclasses.fields(cls)}
        return cls(**{**kept, "flags": tuple(record["flags"])})
