"""Descriptors by name: what is kept of a shape, and how a set of them is compared.

``descriptor_named("srg")`` is the endpoint features of the spectral Reeb graph, compared by a measure of D;
``extended`` the same matching on endpoints that see the surface; the others are single vectors from the literature.
``limb_skeleton`` is the skeleton whose endpoints ``extended`` matches.
One ``Surface`` for several descriptors computes what they share once. ``Kept`` is what is stored of a shape.
"""

from reebase.descriptors.kept import Kept
from reebase.descriptors.limbs import limb_skeleton
from reebase.descriptors.registry import DESCRIPTORS, Descriptor, descriptor_named
from reebase.descriptors.surface import Surface, surface_of

__all__ = ["DESCRIPTORS", "Descriptor", "Kept", "Surface", "descriptor_named", "limb_skeleton", "surface_of"]
