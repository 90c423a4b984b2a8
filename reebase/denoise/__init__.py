"""Removing noise from a mesh: positions in, positions out, the faces untouched.

``denoise(mesh, method)`` runs a filter of ``METHODS`` by name; each family is a module of its own.
``choose`` says what ``auto`` would run and why.
``add_noise`` makes noisy meshes by seed, and the measures in ``errors`` say how far a result is from the
truth.
"""

from reebase.denoise.automatic import Choice, Part
from reebase.denoise.errors import (
    Errors,
    displacement,
    edge_angle,
    face_normal_error,
    mean_angle,
    measure_errors,
    vertex_error,
    visual_error,
    volume_change,
)
from reebase.denoise.filters import BOUNDARIES, METHODS, apply_choice, choose, denoise
from reebase.denoise.noise import NOISES, add_noise
from reebase.denoise.soup import joined_soup

__all__ = [
    "BOUNDARIES", "METHODS", "NOISES", "Choice", "Errors", "Part", "add_noise", "apply_choice", "choose", "denoise",
    "displacement", "edge_angle", "face_normal_error", "joined_soup", "mean_angle", "measure_errors", "vertex_error",
    "visual_error", "volume_change",
]  # fmt: skip
