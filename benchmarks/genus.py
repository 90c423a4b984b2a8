"""Whether the cycles of the Reeb graph are the handles of the surface, on closed meshes.

    ./run python benchmarks/genus.py [SET ...] [--bands 128]

SET is a folder of meshes, or `synthetic`; by default articulated-a, rigid-a and hires-a, looked for under $REEBASE_DATA
or ../shared/data, and the synthetic set. Of every mesh that is one closed manifold the genus is 1 less half of Euler's
V - E + F, and the cycles are those of the Reeb graph of phi_2, and of the skeleton, which pruning leaves them. Prints
how many agree by genus, and of the others how many cycles there are with 1,024 bands: where these agree, a handle was
narrower than a band.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

from retrieval import DATA

from reebase.errors import ReebaseError
from reebase.evaluation.synthetic import synthetic_set
from reebase.mesh import Mesh, clean, read
from reebase.skeleton import MAX_BANDS, prune, reeb_graph
from reebase.spectrum import eigenpairs, operator


def meshes(name: str) -> list[tuple[str, Mesh | Path]]:
    if name == "synthetic":
        return [(shape.name, shape.mesh) for shape in synthetic_set()]
    folder = Path(name) if Path(name).is_dir() else DATA / name
    return [(path.name, path) for path in sorted(folder.iterdir()) if path.suffix not in (".csv", "")]


def main() -> None:
    present = [name for name in ("articulated-a", "rigid-a", "hires-a") if (DATA / name).is_dir()]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", default=[*present, "synthetic"])
    parser.add_argument("--bands", type=int, default=128)
    options = parser.parse_args()
    for name in options.sets:
        closed, right, wrong, left_out = Counter[int](), Counter[int](), [], 0
        for title, source in meshes(name):
            try:
                mesh, health = clean(read(source) if isinstance(source, Path) else source)
            except ReebaseError:
                left_out += 1
                continue
            if health.genus is None or health.components > 1:
                left_out += 1
                continue
            values = eigenpairs(operator(mesh)).fiedler
            graph = reeb_graph(mesh, values, options.bands, "area")
            closed[health.genus] += 1
            if graph.cycles == prune(graph).cycles == health.genus:
                right[health.genus] += 1
            else:
                fine = reeb_graph(mesh, values, MAX_BANDS, "area").cycles
                wrong.append((title, health.genus, graph.cycles, prune(graph).cycles, fine))
        print(f"\n{name}: {right.total()} of {closed.total()} agree; {left_out} are open, in parts or non-manifold")
        for genus, count in sorted(closed.items()):
            print(f"  genus {genus}: {right[genus]} of {count}")
        for title, genus, cycles, pruned, fine in wrong:
            print(f"  {title}: genus {genus}, cycles {cycles}, pruned {pruned}, at {MAX_BANDS} bands {fine}")


if __name__ == "__main__":
    main()
