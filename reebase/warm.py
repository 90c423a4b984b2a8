"""Compile every kernel once and keep the machine code, so that no mesh and no query ever waits for it.

    python -m reebase.warm

numba stores what it compiles beside the sources (or in the user's cache folder where those are read-only).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np

from reebase.mesh.mesh import Mesh

__all__ = ["sample", "warm"]


def sample() -> Mesh:
    """A closed star-shaped mesh of 1538 vertices with two arms on either side: four endpoints."""
    rows, columns = 24, 64
    polar = np.pi * np.arange(1, rows + 1)[:, None] / (rows + 1)
    around = 2 * np.pi * np.arange(columns)[None, :] / columns
    radius = np.ones((rows, columns))
    for direction, length in ((0.6, 3.4), (-0.6, 3.0), (2.5, 3.2), (3.75, 2.8)):
        away = np.angle(np.exp(1j * (around - direction)))
        radius += length * np.exp(-((away / 0.25) ** 2)) * np.sin(polar) ** 8
    grid = np.stack(
        [
            radius * np.sin(polar) * np.cos(around),
            radius * np.sin(polar) * np.sin(around),
            radius * np.cos(polar) * np.ones_like(around),
        ],
        axis=-1,
    ).reshape(-1, 3)
    vertices = np.vstack([[0, 0, 1], grid, [0, 0, -1]])
    index = 1 + np.arange(rows * columns).reshape(rows, columns)
    right = np.roll(index, -1, axis=1)
    upper = np.stack([index[:-1], index[1:], right[:-1]], axis=-1).reshape(-1, 3)
    lower = np.stack([right[:-1], index[1:], right[1:]], axis=-1).reshape(-1, 3)
    north = np.stack([np.zeros(columns, dtype=int), index[0], right[0]], axis=-1)
    south = np.stack([np.full(columns, len(vertices) - 1), right[-1], index[-1]], axis=-1)
    return Mesh(vertices, np.vstack([north, upper, lower, south]))


FACET = b"solid s facet normal 0 0 1 outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 1 0 endloop endfacet endsolid s"
"""An STL file in text."""


def warm(progress: Callable[[str, float], None] | None = None) -> None:
    """Walk every path that compiles: the pipeline, filters, measures, the index, descriptors.

    progress: called with what begins and the fraction of its part that is done.
    """
    from reebase.denoise import METHODS, denoise
    from reebase.descriptors import DESCRIPTORS, Surface
    from reebase.evaluation.matrix import dissimilarity_matrix
    from reebase.matching import MEASURES
    from reebase.mesh.read import read
    from reebase.mesh.write import to_bytes
    from reebase.pictures.thumbnail import thumbnail
    from reebase.pipeline import describe
    from reebase.search import Index

    if progress is not None:
        progress("readers", 0.0)
    for data in (to_bytes(sample(), "obj"), to_bytes(sample(), "off"), FACET):
        read(data)
    features = describe(sample(), progress=progress).features
    apart = sample()
    describe(Mesh(np.vstack([apart.vertices, apart.vertices + 9]), np.vstack([apart.faces, apart.faces + 1538])))
    for number, method in enumerate(METHODS):
        if progress is not None:
            progress(f"filter {method}", number / len(METHODS))
        denoise(sample(), method)
    thumbnail(sample())
    index = Index()
    index.add("sample", features)
    for number, measure in enumerate(MEASURES):
        if progress is not None:
            progress(f"measure {measure}", number / len(MEASURES))
        dissimilarity_matrix([features, features], measure)
        index.query(features, measure=measure)
    surface = Surface(sample())
    for number, descriptor in enumerate(DESCRIPTORS.values()):
        if progress is not None:
            progress(f"descriptor {descriptor.name}", number / len(DESCRIPTORS))
        descriptor.distances([descriptor.describe(surface)] * 2)


def main() -> None:
    """Warm the cache, saying what is being compiled."""
    start = time.perf_counter()

    before, after = ("\r", "") if sys.stderr.isatty() else ("", "\n")

    def say(stage: str, _: float) -> None:
        seconds = time.perf_counter() - start
        sys.stderr.write(f"{before}Reebase: compiling the kernels (once): {stage:<32} {seconds:4.0f} s{after}")
        sys.stderr.flush()

    warm(say)
    done = f"Reebase: the kernels are compiled and kept ({time.perf_counter() - start:.0f} s)."
    sys.stderr.write(f"{before}{done:<80}".rstrip(" " if after else "") + "\n")


if __name__ == "__main__":
    main()
