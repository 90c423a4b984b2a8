"""Files from the wild through the worker's child: each is indexed with its health, or refused with a code.

    ./run python benchmarks/messy.py [--data DIR] [--only WORD] [--clean] [--markdown FILE] [FOLDER ...]

Every file of the folders (by default messy-a under --data, REEBASE_DATA or ../shared/data) is described as an upload
is, in a guarded child with the service's own settings and descriptors. A row says what came of it: a code and its
words, or what the health report says, with seconds of the child and the most memory it had. Where trimesh reads the
file too, the report is held against its arrays: counts, area and bounds as read; then, with trimesh's vertices merged,
whether the surface is closed. --clean does the same with the meshes of the other folders, of which all must be indexed.
Exits 1 for a child that did not end by itself, for an error that is not one of ours, and for a clean mesh that was
refused.
"""

from __future__ import annotations

import argparse
import io
import os
import sys
import time
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from reebase.descriptors import DESCRIPTORS
from reebase.errors import UnknownFormat
from reebase.mesh.health import Health
from reebase.mesh.read import FORMATS, read, sniff
from reebase.pipeline import Description, Profile
from store.settings import Settings
from worker.guards import ChildLimits
from worker.sandbox import ChildError, Sandbox

try:
    import trimesh
except ImportError:
    trimesh = None

CLEAN = ("articulated-a", "rigid-a", "hires-a")
NOT_OURS = ("child_crashed", "internal_error", "out_of_memory", "timed_out")
OUTPUTS = ("description", "kept", "cleaned", "denoised", "display", "thumbnail", "limbs")


@dataclass(frozen=True)
class Outcome:
    """What came of one file. told: words of the refusal, or what health says; beside: what trimesh sees otherwise."""

    name: str
    code: str
    told: str
    beside: str
    seconds: float
    megabytes: float


def settings() -> tuple[ChildLimits, dict[str, int], list[str]]:
    """What the worker gives a child by default: its limits, those of a file, and the descriptors."""
    found = Settings()
    limits = ChildLimits(
        memory_bytes=found.child_memory_bytes, cpu_seconds=found.child_cpu_seconds,
        wall_seconds=found.child_wall_seconds, file_bytes=found.child_file_bytes,
    )  # fmt: skip
    reading = {"bytes": found.max_upload_bytes, "vertices": found.max_vertices, "faces": found.max_faces}
    return limits, reading, ["duplicates", *(name for name in DESCRIPTORS if name in found.descriptors)]


def outcome(sandbox: Sandbox, path: Path, reading: dict[str, int], descriptors: list[str]) -> Outcome:
    """Describe the file in a child."""
    data = path.read_bytes()
    began = time.perf_counter()
    megabytes = 0.0
    try:
        format = sniff(data, path.name) if data else None
        arguments = {
            "format": format, "limits": reading, "profile": Profile().to_json(), "descriptors": descriptors,
        }  # fmt: skip
        with sandbox.run("describe", arguments, data, OUTPUTS) as finished:
            health = Description.load(finished.files["description"]).health
            lacked = finished.answer["refused"]
            megabytes = finished.peak_bytes / 2**20
        seconds = time.perf_counter() - began
        told = in_words(health) + "".join(f"; without {name}: {one['detail']}" for name, one in lacked.items())
        return Outcome(path.name, "", told, beside(path, health), seconds, megabytes)
    except UnknownFormat as refusal:  # at the door, before anything is stored
        code, message = refusal.code, refusal.message
    except ChildError as refusal:
        code, message = refusal.code, str(refusal.detail["message"])
    return Outcome(path.name, code, message, "", time.perf_counter() - began, megabytes)


def in_words(health: Health) -> str:
    """The health report in one line."""
    shape = f"{health.vertices_read}/{health.faces_read} read, {health.vertices}/{health.faces} kept"
    form = "closed" if health.closed else f"{health.boundary_loops} holes"
    genus = "" if health.genus is None else f", genus {health.genus}"
    parts = f"{health.components} part{'s' if health.components > 1 else ''}"
    repairs = "".join(f", {name.replace('_', ' ')} {count}" for name, count in health.repairs.items())
    flags = f" [{' '.join(health.flags)}]" if health.flags else ""
    return f"{shape}; {parts}, {form}{genus}{repairs}{flags}"


def beside(path: Path, health: Health) -> str:
    """What trimesh sees otherwise, empty when it agrees."""
    if trimesh is None or path.suffix[1:].lower() not in FORMATS:
        return ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            theirs = trimesh.load(io.BytesIO(path.read_bytes()), path.suffix[1:].lower(), process=False, force="mesh")
            counts, area, bounds = (len(theirs.vertices), len(theirs.faces)), float(theirs.area), theirs.bounds
            theirs.merge_vertices(merge_tex=True, merge_norm=True)
            theirs.update_faces(theirs.nondegenerate_faces() & theirs.unique_faces())
            closed = bool(theirs.is_watertight)
    except Exception as error:
        return f"trimesh: {type(error).__name__}"
    if not counts[1]:
        return "trimesh: no faces"
    found = []
    if counts != (health.vertices_read, health.faces_read):
        found.append(f"reads {counts[0]}/{counts[1]}")
    if not np.isclose(area, health.area, rtol=1e-6):
        found.append(f"area {area:.6g}, ours {health.area:.6g}")
    ours = read(path)
    low, high = ours.vertices.min(axis=0), ours.vertices.max(axis=0)
    used = ours.vertices[np.unique(ours.faces)]
    near = [np.allclose(bounds, one, rtol=1e-6) for one in ([low, high], [used.min(axis=0), used.max(axis=0)])]
    if not any(near):
        found.append("other bounds")
    if closed != health.closed:
        found.append("closed" if closed else "open")
    return "trimesh: " + ", ".join(found) if found else ""


def table(rows: list[Outcome]) -> str:
    """All rows as Markdown."""
    lines = ["| file | outcome | what is said | beside trimesh | s | MB |", "|---|---|---|---|---|---|"]
    for row in rows:
        told, code = row.told.replace("|", "\\|"), row.code or "indexed"
        megabytes = f"{row.megabytes:.0f}" if row.megabytes else ""
        lines.append(f"| {row.name} | {code} | {told} | {row.beside} | {row.seconds:.2f} | {megabytes} |")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    here = Path(__file__).resolve().parent
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--data", type=Path, default=os.environ.get("REEBASE_DATA", here / "../../shared/data"))
    parser.add_argument("--only", default="", help="files whose name holds this")
    parser.add_argument("--clean", action="store_true", help="the clean folders too")
    parser.add_argument("--markdown", type=Path, help="write the table to this file")
    chosen = parser.parse_args()
    folders = chosen.folders or [Path(chosen.data) / "messy-a"]
    clean = [Path(chosen.data) / name for name in CLEAN] if chosen.clean else []
    limits, reading, descriptors = settings()
    wrong, rows = 0, []
    with Sandbox(limits) as sandbox:
        for folder in [*folders, *clean]:
            counts: dict[str, int] = {}
            seconds = 0.0
            for path in sorted(folder.iterdir()):
                if path.suffix in (".csv", ".md") or chosen.only not in path.name:
                    continue
                found = outcome(sandbox, path, reading, descriptors)
                counts[found.code or "indexed"] = counts.get(found.code or "indexed", 0) + 1
                seconds += found.seconds
                wrong += found.code in NOT_OURS or (folder in clean and found.code != "")
                if folder not in clean or found.code:
                    rows.append(found)
                    print(f"{found.name[:50]:50} {found.code or 'indexed':24} {found.seconds:6.2f} s", flush=True)
                    print(f"      {found.told}\n      {found.beside}".rstrip(), flush=True)
            listed = ", ".join(f"{count} {code}" for code, count in sorted(counts.items()))
            print(f"{folder.name}: {sum(counts.values())} files in {seconds:.1f} s: {listed}", flush=True)
    if chosen.markdown:
        chosen.markdown.write_text(table(rows) + "\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
