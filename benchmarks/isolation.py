"""What it costs to describe a mesh in a guarded child instead of in the process itself.

    python benchmarks/isolation.py [--runs N] [FILE ...]

Each mesh is described and its results are written, in turn in this process and in a child forked from the warmed
zygote, N times; the difference of the medians is the cost of isolation. Wall time suffers from whatever else runs on
the machine; processor time hardly does: of this process, and of the child until it reports. The fork itself is in the
wall time only, and the child's end in neither: nobody waits for it.
The claim: below 15 ms on an idle machine.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from pathlib import Path

from reebase import warm
from reebase.mesh.write import to_bytes
from reebase.pipeline import Description, Profile, describe
from worker.sandbox import Sandbox

Cost = tuple[float, float]
"""Wall and processor time in seconds."""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("files", nargs="*", type=Path)
    chosen = parser.parse_args()
    meshes = {path.name: path.read_bytes() for path in chosen.files}
    if not meshes:
        meshes = {"sample (1250 vertices)": to_bytes(warm.sample(), "ply")}
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors, Python {sys.version.split()[0]}")
    began = time.perf_counter()
    with Sandbox() as sandbox:
        print(f"zygote warm after {time.perf_counter() - began:.2f} s")
        for guard in sandbox.guards:
            print(f"  {'on ' if guard.on else 'OFF'} {guard.name}: {guard.note}")
        print(f"{'ms, medians':<28}{'here':>10}{'child':>10}{'cost':>10}{'here, CPU':>14}{'child':>10}{'cost':>10}")
        row("nothing", [((0.0, 0.0), in_child(sandbox, "probe", None)) for _ in range(chosen.runs)])
        for name, data in meshes.items():
            here(data)
            in_child(sandbox, "describe", data)
            row(name, [(here(data), in_child(sandbox, "describe", data)) for _ in range(chosen.runs)])


def row(name: str, pairs: list[tuple[Cost, Cost]]) -> None:
    columns = []
    for which in (0, 1):
        own = statistics.median(first[which] for first, _ in pairs) * 1000
        child = statistics.median(second[which] for _, second in pairs) * 1000
        columns.append(f"{own:>10.1f}{child:>10.1f}{child - own:>10.1f}")
    print(f"{name:<28}{columns[0]}    {columns[1]}")


def here(data: bytes) -> Cost:
    wall, cpu = time.perf_counter(), time.process_time()
    found = describe(data)
    to_bytes(found.cleaned, "ply")
    to_bytes(found.denoised, "ply", scalars={"phi2": found.field})
    return time.perf_counter() - wall, time.process_time() - cpu


def in_child(sandbox: Sandbox, computation: str, data: bytes | None) -> Cost:
    wall, cpu = time.perf_counter(), time.process_time()
    arguments = {"format": None, "profile": Profile().to_json(), "limits": {}} if data else {}
    outputs = ("description", "cleaned", "denoised") if data else ()
    with sandbox.run(computation, arguments, data or b"", outputs) as finished:
        if data:
            Description.load(finished.files["description"])
        for name in outputs[1:]:
            finished.files[name].read()
    return time.perf_counter() - wall, time.process_time() - cpu + finished.cpu_seconds


if __name__ == "__main__":
    main()
