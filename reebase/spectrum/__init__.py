"""The Laplace-Beltrami operator, its first eigenpairs and the scalar fields made of them (METHOD §3).

operator.py: stiffness C and mass R. eigen.py: the smallest eigenpairs at unit area. fields.py: the field that
the Reeb graph is taken of, by name.
"""

from reebase.spectrum.eigen import NEAR_DEGENERATE, Spectrum, eigenpairs
from reebase.spectrum.fields import FIELDS, Field, eigenpairs_needed, field
from reebase.spectrum.operator import KINDS, Operator, linked, mixed_voronoi, operator, stiffness

__all__ = [
    "FIELDS", "KINDS", "NEAR_DEGENERATE", "Field", "Operator", "Spectrum", "eigenpairs", "eigenpairs_needed",
    "field", "linked", "mixed_voronoi", "operator", "stiffness",
]  # fmt: skip
