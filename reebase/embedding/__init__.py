"""Points in the plane for shapes of which only dissimilarities are known, neighbours beside neighbours."""

from reebase.embedding.plane import MOST, neighbours_kept, plane

__all__ = ["MOST", "neighbours_kept", "plane"]
