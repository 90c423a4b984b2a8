"""A finding: two shapes that are one, what was done to one of them, the numbers behind it, and a sentence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from reebase.duplicates.evidence import FLAT, Evidence

__all__ = ["CLASSES", "CONFIDENCES", "Finding", "finding_of", "same_bytes"]

CLASSES = (
    "same_bytes", "same_mesh", "noisy", "decimated", "remeshed", "moved", "rescaled", "mirrored", "copies",
)  # fmt: skip
"""What evidence there can be. The first that applies of the first five says what became of the triangles: none of them
touched; the same but perhaps in another order, format or precision; the same with displaced vertices; fewer; others.
"""

CONFIDENCES = ("certain", "strong", "fair")
"""certain: the same triangles to rounding. strong: within the residual that remeshing and decimating leave. fair:
within that of noise, which two different shapes can come near to. The error rates were measured
(docs/duplicates.md)."""

STRONG = 0.25
STRONG_SIZE = 0.02
"""Greatest residual of ``strong``, of all but the farthest hundredth, in mean edge lengths and in sizes of the shape:
of a box of twelve triangles a tenth of an edge is another box."""

SAME_FACES = 0.99
MOST_FACES = 0.5
"""Share of common faces from which on the mesh is the same, and from which on it is, with displaced vertices."""

AS_MANY = 1.25
"""Factor between counts of vertices from which on one mesh is a decimation of the other."""

EXACT = 1e-4
ROUGHLY = 0.01
"""How far a scale may be from 1, or from a known factor, where the triangles are the same, and where they are not."""

UNITS = {
    2.54: "inches and centimetres", 3.28084: "feet and metres", 10.0: "millimetres and centimetres",
    12.0: "inches and feet", 25.4: "inches and millimetres", 30.48: "feet and centimetres",
    39.37008: "inches and metres", 100.0: "centimetres and metres", 304.8: "feet and millimetres",
    1000.0: "millimetres and metres",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Finding:
    """first, second: names of the shapes. classes: of CLASSES, in that order. confidence: of CONFIDENCES.

    scale: what the first must be multiplied by to have the second's size. units: which units were taken for one
    another, where the scale says so. copies: how many times the first holds the second (or its own largest part, where
    first and second are one shape), as far as they were counted, which the words say; 1 but for ``copies``. evidence:
    the numbers; None where bytes are the same. words: the finding as a sentence.
    """

    first: str
    second: str
    classes: tuple[str, ...]
    confidence: str
    scale: float
    units: str | None
    copies: int
    evidence: Evidence | None
    words: str

    def to_json(self) -> dict[str, Any]:
        """JSON-serialisable."""
        record = {
            "first": self.first, "second": self.second, "classes": list(self.classes), "confidence": self.confidence,
            "scale": self.scale, "units": self.units, "copies": self.copies, "words": self.words, "evidence": None,
        }  # fmt: skip
        if self.evidence is not None:
            found = self.evidence
            record["evidence"] = {
                "residual": found.residual, "farthest": found.farthest, "of_size": found.of_size,
                "same_faces": found.same_faces, "vertices": found.vertices, "area": found.area,
                "volume": found.volume, "mirrored": found.mirrored,
                "degrees": found.similarity.degrees, "rotation": found.similarity.rotation.tolist(),
                "shift": found.similarity.shift.tolist(),
            }  # fmt: skip
        return record


def same_bytes(first: str, second: str) -> Finding:
    """The finding of two files that do not differ in a byte."""
    words = f"{first} and {second} are the same file, byte for byte."
    return Finding(first, second, ("same_bytes",), "certain", 1.0, None, 1, None, words)


def finding_of(
    first: str, second: str, evidence: Evidence, size: float, copies: int = 1, *, more: bool = False
) -> Finding:
    """What the evidence says. size: of the second, against which a shift counts or not. more: than ``copies`` may be
    there."""
    same = evidence.same_faces >= SAME_FACES and evidence.residual <= FLAT
    if same:
        mesh = "same_mesh"
    elif evidence.same_faces >= MOST_FACES:
        mesh = "noisy"
    elif not 1 / AS_MANY <= evidence.vertices <= AS_MANY:
        mesh = "decimated"
    else:
        mesh = "remeshed"
    slack = EXACT if same else ROUGHLY
    similarity = evidence.similarity
    rescaled = abs(similarity.scale - 1) > slack
    at_rest = similarity.degrees <= 100 * slack and float(abs(similarity.shift).max()) <= slack * size
    told = {
        "moved": copies == 1 and not at_rest, "rescaled": rescaled, "mirrored": evidence.mirrored is True,
        "copies": copies > 1,
    }  # fmt: skip
    classes = (mesh, *(name for name, is_so in told.items() if is_so))
    close = evidence.farthest <= STRONG and evidence.of_size <= STRONG_SIZE
    confidence = "certain" if same else "strong" if close else "fair"
    units = _units(similarity.scale, slack) if rescaled else None
    counted = f"{'at least ' if more else ''}{copies} copies" if copies > 1 else None
    words = _words(first, second, evidence, classes, units, counted)
    return Finding(first, second, classes, confidence, similarity.scale, units, copies, evidence, words)


def _units(scale: float, slack: float) -> str | None:
    factor = max(scale, 1 / scale)
    return next((name for known, name in UNITS.items() if abs(factor / known - 1) <= slack), None)


def _words(
    first: str, second: str, evidence: Evidence, classes: tuple[str, ...], units: str | None,
    copies: str | None,
) -> str:  # fmt: skip
    within = f"within {evidence.farthest:.2g} mean edge lengths or {evidence.of_size:.2g} of its size"
    less = f"{min(evidence.vertices, 1 / evidence.vertices):.0%} of the vertices"
    parts = {
        "same_mesh": "the same triangles",
        "noisy": f"the same triangles with displaced vertices, {within}",
        "remeshed": f"other triangles on the same surface, {within}",
        "decimated": f"{'the first' if evidence.vertices < 1 else 'the second'} with {less}, {within}",
        "moved": "moved",
        "rescaled": _rescaled(evidence.similarity.scale, units),
        "mirrored": "mirrored",
    }
    said = ", ".join(parts[name] for name in classes if name in parts)
    if evidence.mirrored is None:
        said += "; its mirror image looks the same, so whether it was mirrored cannot be told"
    if copies is not None:
        whose = "its largest part" if first == second else second
        return f"{first} holds {copies} of {whose}: {said}."
    return f"{first} and {second} are one shape: {said}."


def _rescaled(scale: float, units: str | None) -> str:
    which, factor = ("second", scale) if scale > 1 else ("first", 1 / scale)
    larger = f"the {which} is {factor:.6g} times as large"
    return larger if units is None else f"{larger} ({units})"
