"""Descriptors by name: what is kept of a shape, and how two of them are compared.

``descriptor_named("srg")`` is the endpoint features of the spectral Reeb graph, compared by a measure of D.
"""

from reebase.descriptors.registry import DESCRIPTORS, Descriptor, descriptor_named

__all__ = ["DESCRIPTORS", "Descriptor", "descriptor_named"]
