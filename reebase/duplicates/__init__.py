"""Near-duplicates: shapes that are one shape, exported again, moved, rescaled, mirrored, remeshed, decimated, or there
several times in one file.

    found = find_duplicates([Shape.of(name, mesh) for name, mesh in meshes.items()])
    for finding in found:
        print(finding.words)

Each finding names what was done, with the numbers that say so; nothing is ever deleted. signature.py: what is kept of a
shape; alignment.py and evidence.py: how two meshes lie on one another; findings.py: what that means in words.
"""

from reebase.duplicates.evidence import Evidence, compared
from reebase.duplicates.find import Candidate, Shape, candidates, comparisons, find_duplicates
from reebase.duplicates.findings import CLASSES, CONFIDENCES, Finding
from reebase.duplicates.signature import NUMBERS, signature

__all__ = [
    "CLASSES", "CONFIDENCES", "NUMBERS", "Candidate", "Evidence", "Finding", "Shape", "candidates", "compared",
    "comparisons", "find_duplicates", "signature",
]  # fmt: skip
