"""Retrieval of deformable 3D shapes by their spectral Reeb graphs, with reasons."""

__version__ = "0.1.0"
