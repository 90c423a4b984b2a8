"""A description with chosen features, for tests that need no pipeline."""

from __future__ import annotations

import numpy as np

from reebase.mesh.health import Health
from reebase.mesh.mesh import Mesh
from reebase.pipeline import Description, Profile
from reebase.skeleton.graph import Skeleton


def description(features: np.ndarray, profile: Profile | None = None) -> Description:
    """A description with these features; all else is a single triangle."""
    mesh = Mesh(np.eye(3), np.array([[0, 1, 2]]))
    health = Health(3, 1, 3, 1, 3, 1, 3, 1, 0, 1, None, False, True, 0.87, None, 1.41, 1.0, {"merged": 2})
    skeleton = Skeleton.assembled(
        np.arange(9.0).reshape(3, 3), np.array([1.0, 2.0, 3.0]), np.ones(3), np.array([0, 1, 2], np.int32),
        np.array([[0, 1], [1, 2]], np.int32), 1,
    )  # fmt: skip
    return Description(
        mesh, mesh, health.flagged("open_surface"), np.array([0.0, 1.5, 2.5]), np.zeros(3), skeleton,
        np.asarray(features, float), {"read": 0.01, "clean": 0.02}, profile or Profile(),
    )  # fmt: skip
