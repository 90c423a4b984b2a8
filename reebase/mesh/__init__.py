"""The mesh and what is done to it before any mathematics: read, write, check, repair."""

from reebase.mesh.clean import clean
from reebase.mesh.health import FLAGS, Health
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import FORMATS, Limits, read, sniff
from reebase.mesh.topology import largest_component
from reebase.mesh.write import to_bytes, write

__all__ = [
    "FLAGS", "FORMATS", "Health", "Limits", "Mesh", "clean", "largest_component", "read", "sniff", "to_bytes", "write",
]  # fmt: skip
