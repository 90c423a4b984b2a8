"""What the skeleton of a shape of several parts has in common with that of the whole: endpoints, and D by `srg`.

    ./run python benchmarks/components.py [--shapes 3] [--vertices 3000] [FILE ...]

Shapes of the synthetic set, each in three states: whole, a closed surface; `cut` into eight pieces along edges, each
moved by a hair, so that nothing is shared; and `built` of one closed surface for each body and limb, which overlap, as
modellers build things. Prints for the latter two, with the parts joined and with the largest alone: the share with as
many endpoints as the whole, the median D to their own whole, and how often that is the nearest of all wholes; beside
them the median D between wholes of one class and between classes. Then, for files: parts, joins, endpoints and seconds.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull

from reebase.evaluation.synthetic import CLASSES, _meshed
from reebase.evaluation.synthetic.figures import FIGURES
from reebase.evaluation.synthetic.implicit import Ellipsoid, Figure
from reebase.matching import dissimilarity
from reebase.mesh import Mesh
from reebase.mesh.geodesics import farthest_points
from reebase.pipeline import COMPONENTS, Description, Profile, describe

PIECES = 8
HAIR = 2e-3
"""How far pieces are moved, in lengths of the bounding box."""


def together(meshes: list[Mesh]) -> Mesh:
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]),
    )


def cut(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """Each face to the piece of its first corner's nearest of a few points spread evenly."""
    piece = farthest_points(mesh, PIECES).nearest[mesh.faces[:, 0]]
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    return together([
        Mesh(mesh.vertices + HAIR * size * random.uniform(-0.5, 0.5, 3), mesh.faces[piece == one])
        for one in range(PIECES)
    ])  # fmt: skip


def ellipsoid(body: Ellipsoid, vertices: int) -> Mesh:
    i = np.arange(vertices) + 0.5
    z, turn = 1 - 2 * i / vertices, np.pi * (1 + 5**0.5) * i
    points = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], axis=1)
    faces = ConvexHull(points).simplices
    a, b, c = points[faces].transpose(1, 0, 2)
    inside = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inside] = faces[inside][:, ::-1]
    return Mesh(body.centre + points @ (body.frame * body.radii).T, faces)


def built(figure: Figure, vertices: int) -> Mesh | None:
    count = max(500, vertices // len(figure.parts))
    each = [
        ellipsoid(part, count) if isinstance(part, Ellipsoid) else _meshed(Figure((part,)), count, None)
        for part in figure.parts
    ]
    return None if any(mesh is None for mesh in each) else together([mesh for mesh in each if mesh is not None])


def shapes(count: int, vertices: int) -> Iterator[tuple[str, Mesh, Mesh, Mesh]]:
    for label in CLASSES:
        made = 0
        for index in range(20 * count):
            random = np.random.default_rng([index, CLASSES.index(label)])
            figure = FIGURES[label](random)
            whole = _meshed(figure, vertices, random)
            parts = None if whole is None else built(figure, vertices)
            if whole is not None and parts is not None:
                yield label, whole, cut(whole, random), parts
                made += 1
            if made == count:
                break


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--shapes", type=int, default=3)
    parser.add_argument("--vertices", type=int, default=3000)
    options = parser.parse_args()
    if options.shapes:
        synthetic(options.shapes, options.vertices)
    for path in options.files:
        began = time.process_time()
        found = describe(path)
        joins = int(found.skeleton.joins.sum())
        print(
            f"{path.name}: {found.health.components} parts, {joins} joins, {len(found.skeleton.endpoints)} endpoints, "
            f"{len(found.skeleton.positions)} nodes, {time.process_time() - began:.2f} s", flush=True,
        )  # fmt: skip


def synthetic(count: int, vertices: int) -> None:
    labels: list[str] = []
    wholes: list[Description] = []
    states: dict[tuple[str, str], list[Description]] = {}
    for label, whole, *others in shapes(count, vertices):
        labels.append(label)
        wholes.append(describe(whole))
        for state, mesh in zip(("cut", "built"), others, strict=True):
            for components in COMPONENTS:
                found = describe(mesh, Profile(components=components))
                states.setdefault((state, components), []).append(found)
    D = np.array([[dissimilarity(a.features, b.features) for a in wholes] for b in wholes])
    own = np.array([[a == b for a in labels] for b in labels])
    apart = ~np.eye(len(labels), dtype=bool)
    within, between = np.median(D[own & apart]), np.median(D[~own])
    print(f"{len(labels)} wholes: median D {within:.3f} within a class, {between:.3f} else")
    for (state, components), found in states.items():
        E = np.array([[dissimilarity(one.features, whole.features) for whole in wholes] for one in found])
        same = np.mean([len(a.features) == len(b.features) for a, b in zip(found, wholes, strict=True)])
        first = np.mean(E.argmin(axis=1) == np.arange(len(labels)))
        nearest = np.mean([labels[at] == label for at, label in zip(E.argmin(axis=1), labels, strict=True)])
        print(
            f"{state:6s}{components:8s}: as many endpoints {same:.2f}, D to the whole {np.median(np.diag(E)):.3f}, "
            f"nearest its own {first:.2f}, its class {nearest:.2f}", flush=True,
        )  # fmt: skip


if __name__ == "__main__":
    main()
