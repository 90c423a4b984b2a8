"""Retrieval of deformable 3D shapes by their spectral Reeb graphs, with reasons.

    mesh = reebase.read("octopus.ply")
    mesh, health = reebase.clean(mesh)
    graph = reebase.skeleton(reebase.denoise(mesh))
    reebase.dissimilarity(graph, other)
    reebase.match(graph, other)

``describe`` walks all stages at once. The typed client of the HTTP service is ``reebase.client``.
"""

from reebase.denoise import denoise
from reebase.errors import ReebaseError
from reebase.matching import Match, dissimilarity, match
from reebase.mesh import Health, Limits, Mesh, clean, read, write
from reebase.pipeline import Description, Profile, describe, skeleton, skeletons_of_parts
from reebase.skeleton import Skeleton

__all__ = [
    "Description", "Health", "Limits", "Match", "Mesh", "Profile", "ReebaseError", "Skeleton",
    "clean", "denoise", "describe", "dissimilarity", "match", "read", "skeleton", "skeletons_of_parts", "write",
]  # fmt: skip

__version__ = "0.1.0"
