"""Speed of denoising from raw arrays, topology included, beside other tools in the same run, interleaved.

    ./run python benchmarks/denoising_speed.py [--vertices 20000 100000] [--rounds 5] [--methods taubin] [--cost]

The shape of ``lobes.py`` with noise of 0.2 mean edge lengths. Prints medians in microseconds of processor time per
vertex, and how many times as long the peers of each target take; pin it to a core (``taskset -c 0``). --cost:
nanoseconds per vertex of our filters from 5,000 to a million vertices instead, which should stay the same.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from denoising_peers import peers
from lobes import five_lobes

from reebase.denoise import add_noise, denoise
from reebase.mesh.mesh import Mesh

TARGETS = (
    ("finite_volume", 1, "pymeshlab two-step", 1, 6.0),
    ("finite_volume", 1, "trimesh laplacian", 1, 15.0),
    ("finite_volume", 1, "open3d simple", 1, 3.5),
    *(
        (ours, 10, peer, 10, 2.0)
        for ours, theirs in (("laplacian", "laplacian"), ("taubin", "taubin"))
        for peer in ("trimesh " + theirs, "open3d " + theirs, "vtk laplacian", "meshlib relax", "pymeshlab taubin")
    ),
    *((ours, 1, "meshlib by normals", 1, 100.0) for ours in ("bilateral_normal", "guided_normal", "fast_effective")),
)
"""Our filter and iterations, the peer's, and how many times as fast ours should be."""


def ours(name: str) -> Callable[[Mesh, int], Mesh]:
    return lambda mesh, iterations: denoise(mesh, name, iterations)


def timed(run: Callable[[Mesh, int], Mesh], mesh: Mesh, iterations: int) -> float:
    """Seconds of processor time, from arrays to positions."""
    start = time.process_time()
    run(Mesh(mesh.vertices, mesh.faces), iterations)
    return time.process_time() - start


def compare(vertices: int, rounds: int, methods: list[str]) -> None:
    """The targets of these methods at one size."""
    targets = [target for target in TARGETS if target[0] in methods]
    mesh = add_noise(five_lobes(vertices), 0.2)
    others = peers()
    runs = {(name, count): ours(name) for name, count, _, _, _ in targets}
    runs |= {("auto", 1): ours("auto")} if "auto" in methods else {}
    runs |= {(peer, count): others[peer] for _, _, peer, count, _ in targets if peer in others}
    for (_, count), run in runs.items():
        timed(run, mesh, count)
    seconds: dict[tuple[str, int], list[float]] = {key: [] for key in runs}
    for number in range(rounds):
        for key, run in runs.items():
            if key[0] != "meshlib by normals" or number == 0:
                seconds[key].append(timed(run, mesh, key[1]))
    middle = {key: float(np.median(values)) for key, values in seconds.items()}
    print(f"\n{vertices} vertices, microseconds a vertex")
    for (name, count), value in middle.items():
        print(f"{name} x{count}".ljust(28), f"{1e6 * value / vertices:8.3f}   {value:8.3f} s")
    print("\ntimes as fast".ljust(49), "reached  target")
    for name, count, peer, theirs, wanted in targets:
        if (peer, theirs) in middle:
            reached = middle[peer, theirs] / middle[name, count]
            print(f"{name} x{count} / {peer} x{theirs}".ljust(48), f"{reached:7.1f}  {wanted:6.1f}", flush=True)


def cost(rounds: int) -> None:
    """Nanoseconds per vertex by size."""
    names = ("finite_volume", "laplacian", "taubin", "bilateral_normal", "guided_normal", "fast_effective", "auto")
    print("ns per vertex".ljust(18), *(f"{name[:14]:>15}" for name in names))
    for vertices in (5_000, 20_000, 100_000, 350_000, 1_000_000):
        mesh = add_noise(five_lobes(vertices), 0.2)
        for name in names if vertices == 5_000 else ():
            denoise(mesh, name)  # compiles
        found = [min(timed(ours(name), mesh, 1) for _ in range(rounds)) for name in names]
        print(f"{vertices:<18}", *(f"{1e9 * value / vertices:15.0f}" for value in found), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vertices", nargs="+", type=int, default=[20_000, 100_000])
    parser.add_argument("--rounds", type=int, default=5)
    names = [*dict.fromkeys(target[0] for target in TARGETS), "auto"]
    parser.add_argument("--methods", nargs="+", choices=names, default=names, help="only these, and their peers")
    parser.add_argument("--cost", action="store_true", help="our filters from 5,000 to a million vertices")
    options = parser.parse_args()
    if options.cost:
        cost(min(options.rounds, 3))
        return
    for vertices in options.vertices:
        compare(vertices, options.rounds, options.methods)


if __name__ == "__main__":
    main()
