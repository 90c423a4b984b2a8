"""The one path: bytes -> Mesh -> cleaned -> denoised -> operator -> phi_2 -> Reeb graph -> endpoint features.

Every caller walks it: the worker, the evaluation of the synthetic set, the command line and a notebook.
"""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from reebase.mesh.health import Health
from reebase.mesh.mesh import Mesh
from reebase.skeleton.graph import Skeleton

__all__ = ["PIPELINE_VERSION", "STAGES", "Description", "Profile", "describe"]

PIPELINE_VERSION = 1
"""Raised whenever the same mesh and profile would give other numbers; nothing is compared across versions."""

STAGES = ("read", "clean", "denoise", "operator", "eigenpairs", "skeleton", "features")
"""The stages in order; progress names them."""

Progress = Callable[[str, float], None]
"""Called with the stage that begins and the fraction of the whole that is done."""


@dataclass(frozen=True)
class Profile:
    """The parameters of the pipeline; two descriptions are comparable when their ``key`` is the same.

    denoise: name of a filter, or "none". iterations: of that filter, at least 1.
    field: name of the scalar field. bands: number of bands of the Reeb graph, 2 to 1024.
    saliency: "area" or "length"; threshold: branches with less than this share are pruned, in [0, 1).
    area: "band" or "ring", the reading of the relative node area (METHOD §5).
    """

    denoise: str = "finite_volume"
    iterations: int = 1
    field: str = "fiedler"
    bands: int = 64
    saliency: str = "area"
    threshold: float = 0.01
    area: str = "band"

    def to_json(self) -> dict[str, Any]:
        return dataclasses.asdict(self)

    @property
    def key(self) -> str:
        """Hash of the pipeline's version and these parameters, 16 hexadecimal digits."""
        canonical = json.dumps([PIPELINE_VERSION, self.to_json()], sort_keys=True)
        return hashlib.sha256(canonical.encode()).hexdigest()[:16]


@dataclass(frozen=True, eq=False)
class Description:
    """Everything that the pipeline learns about one mesh.

    cleaned, denoised: meshes with the same faces; health: the report with the flags of all stages.
    eigenvalues: the first three of the operator at unit area, (3,), lambda_1 = 0.
    field: the scalar field at each vertex of ``denoised``, (m,), NaN off the largest component.
    skeleton: pruned; features: omega of each endpoint in the order of ``skeleton.endpoints``, (k, 3).
    seconds: stage -> wall time.
    """

    cleaned: Mesh
    denoised: Mesh
    health: Health
    eigenvalues: npt.NDArray[np.float64]
    field: npt.NDArray[np.float64]
    skeleton: Skeleton
    features: npt.NDArray[np.float64]
    seconds: dict[str, float]
    profile: Profile
