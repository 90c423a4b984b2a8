"""Parts that look for their wholes: cut shapes as queries against the whole collection.

    ./run python benchmarks/partial.py [SET ...] [--parts 30] [--descriptors NAME[:MEASURE] ...] [--seed 0]

Of shapes drawn from each SET (as in descriptors.py; articulated-a and rigid-a by default) a limb is cut off, or half of
it, and moved and turned: a limb is what lies nearest along the surface to an endpoint of `extended`, a tenth or a fifth
of the area; a half is the largest piece on one side of a plane through the median of the area. Cuts run along edges;
the part is scaled where --scale says so. Prints how often the shape that it was cut from
comes first and among the first ten, how often the first other shape is of its class, and the share of its class among
the ten first others. Descriptors that are not for parts stand for the usual ranking.
"""

from __future__ import annotations

import argparse

import numpy as np
from retrieval import DATA, load

from reebase.descriptors import Surface, descriptor_named
from reebase.descriptors.extended import endpoints
from reebase.mesh import Mesh
from reebase.mesh.clean import clean
from reebase.mesh.geodesics import geodesic_distances
from reebase.mesh.geometry import face_areas
from reebase.mesh.read import read
from reebase.mesh.topology import largest_component

CUTS = ("limb 0.1", "limb 0.2", "half")
ASKED = ("patches:absolute", "patches:relative", "extended", "hks", "views")


def lowest(mesh: Mesh, values: np.ndarray, share: float) -> Mesh:
    """The largest piece of the faces with the lowest values that make up a share of the area."""
    areas = face_areas(mesh)
    order = np.argsort(values[mesh.faces].mean(axis=1), kind="stable")
    count = int(np.searchsorted(np.cumsum(areas[order]), share * areas.sum())) + 1
    return largest_component(Mesh(mesh.vertices, mesh.faces[order[:count]]))[0]


def part_of(surface: Surface, cut: str, random: np.random.Generator) -> Mesh:
    mesh = surface.body
    if cut == "half":
        part = lowest(mesh, mesh.vertices @ random.normal(size=3), 0.5)
    else:
        tip = int(random.choice(endpoints(surface).vertices))
        part = lowest(mesh, geodesic_distances(mesh, [tip])[0], float(cut.split()[1]))
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    return Mesh(part.vertices @ turn + random.normal(size=3), part.faces)


def scores(distances: np.ndarray, whole: int, labels: np.ndarray) -> tuple[float, float, float, float]:
    order = np.argsort(distances, kind="stable")
    rank = int(np.flatnonzero(order == whole)[0])
    related = labels[order[order != whole]] == labels[whole]
    return float(rank == 0), float(rank < 10), float(related[0]), float(related[:10].mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", default=[s for s in ("articulated-a", "rigid-a") if (DATA / s).is_dir()])
    parser.add_argument("--parts", type=int, default=30)
    parser.add_argument("--descriptors", nargs="+", default=ASKED)
    parser.add_argument("--scale", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    for name in options.sets:
        labels, sources = load(name)
        meshes = [clean(one if isinstance(one, Mesh) else read(one))[0] for one in sources]
        surfaces = [Surface(mesh) for mesh in meshes]
        asked = {one: (descriptor_named(one.partition(":")[0]), one.partition(":")[2] or None)
                 for one in options.descriptors}  # fmt: skip
        kept = {d.name: [d.describe(surface) for surface in surfaces] for d, _ in asked.values()}
        random = np.random.default_rng(options.seed)
        print(f"\n{name}: {len(surfaces)} shapes, {options.parts} parts of each kind")
        print(f"{'':30s}  whole first  in ten   class first  in ten")
        for cut in CUTS:
            found: dict[str, list[tuple[float, ...]]] = {one: [] for one in asked}
            for whole in random.permutation(len(surfaces))[: options.parts]:
                part = part_of(surfaces[whole], cut, random)
                surface = Surface(Mesh(part.vertices * options.scale, part.faces))
                for one, (descriptor, measure) in asked.items():
                    distances = descriptor.distances_to(descriptor.describe(surface), kept[descriptor.name], measure)
                    found[one].append(scores(distances, int(whole), np.array(labels)))
            for one, rows in found.items():
                mean = np.mean(rows, axis=0)
                print(f"{cut:10s} {one:18s}  {mean[0]:11.2f} {mean[1]:8.2f} {mean[2]:12.2f} {mean[3]:7.2f}", flush=True)


if __name__ == "__main__":
    main()
