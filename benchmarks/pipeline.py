"""From upload bytes to stored vectors: meshes a second and core, memory, where the time goes, and growth with size.

    OPENBLAS_NUM_THREADS=1 ./run python benchmarks/pipeline.py [--data DIR] [--vertices 5000 20000 ...] [--limit N]

Every mesh is described as the worker does it: in a child forked from the warmed zygote, inside its default limits, with
all files that are stored of a shape; with all descriptors that the service keeps by default, and with D alone (no
further descriptor, and nothing drawn). Times are processor time of the child, which is what one core can do; the wall
time of the whole exchange stands beside it. Folders: articulated-a and hires-a under --data, REEBASE_DATA or
../shared/data, where present. Growth is measured on closed shapes with five lobes: smooth, numbered along a spiral; and
rough, with noise of a third of an edge and vertices at random. Exits 1 when a mesh is not described.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lobes import five_lobes
from messy import OUTPUTS, settings

from reebase.mesh.mesh import Mesh
from reebase.mesh.write import to_bytes
from reebase.pipeline import STAGES, Description, Profile
from worker.sandbox import ChildError, Sandbox

FOLDERS = ("articulated-a", "hires-a")
SHOWN = (*STAGES, "descriptors")


@dataclass(frozen=True)
class Cost:
    """Of one mesh: vertices as indexed, seconds of the child's processor and of the clock, bytes, seconds by stage."""

    vertices: int
    cpu: float
    wall: float
    peak: int
    stages: dict[str, float]


def described(sandbox: Sandbox, data: bytes, descriptors: list[str], outputs: tuple[str, ...]) -> Cost:
    reading = settings()[1]
    arguments = {"format": "ply", "limits": reading, "profile": Profile().to_json(), "descriptors": descriptors}
    began = time.perf_counter()
    with sandbox.run("describe", arguments, data, outputs) as finished:
        found = Description.load(finished.files["description"])
        for file in finished.files.values():
            file.read()
        if finished.answer["refused"]:
            print(f"  refused: {finished.answer['refused']}")
        wall = time.perf_counter() - began
        return Cost(found.health.vertices, finished.cpu_seconds, wall, finished.peak_bytes, found.seconds)


def folder_row(name: str, costs: list[Cost]) -> None:
    """One line of a folder, and one of where the time goes."""
    cpu, wall = [cost.cpu for cost in costs], [cost.wall for cost in costs]
    vertices = statistics.median(cost.vertices for cost in costs)
    print(
        f"{name:<34}{len(costs):>7}{vertices:>10.0f}{len(cpu) / sum(cpu):>12.1f}{len(wall) / sum(wall):>10.1f}"
        f"{statistics.median(cpu) * 1000:>10.0f}{max(cost.peak for cost in costs) / 2**20:>8.0f}"
    )
    print("      " + where(costs), flush=True)


def where(costs: list[Cost]) -> str:
    """Shares of the stages by the clock; what is left is writing, drawing and the exchange."""
    whole = sum(cost.wall for cost in costs)
    sums = {stage: sum(cost.stages.get(stage, 0.0) for cost in costs) for stage in SHOWN}
    shares = {**sums, "rest": whole - sum(sums.values())}
    return ", ".join(f"{stage} {100 * seconds / whole:.0f} %" for stage, seconds in shares.items() if seconds > 0)


def rough(mesh: Mesh) -> Mesh:
    """Noise of a third of the mean edge, and the vertices in random order."""
    random = np.random.default_rng(0)
    ends = mesh.vertices[mesh.faces]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean()
    moved = mesh.vertices + 0.3 * length * random.standard_normal(mesh.vertices.shape)
    order = random.permutation(len(moved))
    return Mesh(moved[order], np.argsort(order)[mesh.faces].astype(np.int32))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    here = Path(__file__).resolve().parent
    parser.add_argument("--data", type=Path, default=os.environ.get("REEBASE_DATA", here / "../../shared/data"))
    parser.add_argument("--vertices", nargs="*", type=int, default=[5_000, 20_000, 100_000, 350_000, 1_000_000])
    parser.add_argument("--limit", type=int, default=1000, help="meshes of each folder")
    chosen = parser.parse_args()
    limits, _, descriptors = settings()
    kinds = {"all descriptors": (descriptors, OUTPUTS), "D alone": ([], ("description", "kept", "cleaned", "denoised"))}
    print(f"Python {sys.version.split()[0]}, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    failed = 0
    with Sandbox(limits) as sandbox:
        print(f"{'':<34}{'meshes':>7}{'vertices':>10}{'a CPU second':>13}{'by clock':>9}{'median ms':>10}{'MiB':>8}")
        for name in FOLDERS:
            files = sorted((Path(chosen.data) / name).glob("*.ply"))[: chosen.limit]
            for kind, (names, outputs) in kinds.items():
                if files:
                    costs = [described(sandbox, path.read_bytes(), names, outputs) for path in files]
                    folder_row(f"{name}, {kind}", costs)
        print(f"\n{'':<24}{'CPU s':>9}{'us a vertex':>13}{'by clock':>10}{'MiB':>8}   (all descriptors)")
        for vertices in chosen.vertices:
            smooth = five_lobes(vertices)
            for name, mesh in (("smooth", smooth), ("rough", rough(smooth))):
                try:
                    cost = described(sandbox, to_bytes(mesh, "ply"), *kinds["all descriptors"])
                except ChildError as refusal:
                    print(f"{vertices:>9} {name:<14} {refusal.code}: {refusal.detail['message']}", flush=True)
                    failed += 1
                    continue
                print(
                    f"{vertices:>9} {name:<14}{cost.cpu:>9.2f}{cost.cpu / vertices * 1e6:>13.1f}{cost.wall:>10.1f}"
                    f"{cost.peak / 2**20:>8.0f}   {where([cost])}", flush=True,
                )  # fmt: skip
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
