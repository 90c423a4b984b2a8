"""`reebase skeleton`: one mesh, its skeleton, a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from reebase.cli import options
from reebase.cli.output import STDOUT, check_picture, check_target, print_table, results, shown, write_bytes, write_json
from reebase.pipeline import Description, describe
from reebase.skeleton import Skeleton
from reebase.words import counted

SHOWN = 12
"""Parts whose endpoints are counted on the terminal; in JSON are all that have a skeleton."""


def skeleton(
    context: typer.Context,
    mesh: Annotated[Path, typer.Argument(help="A mesh file.", exists=True, dir_okay=False)],
    picture: Annotated[Path | None, typer.Option(help="Write a picture here (.png or .svg).")] = None,
    json_out: options.JsonOut = None,
    profile: options.Named = "default",
    bands: options.Bands = options.DEFAULT.bands,
    denoise: options.Denoise = options.DEFAULT.denoise,
    iterations: options.Iterations = options.DEFAULT.iterations,
    threshold: options.Threshold = options.DEFAULT.threshold,
    levels: options.Levels = options.DEFAULT.levels,
    saliency: options.Saliency = options.DEFAULT.saliency,
    field: options.Field = options.DEFAULT.field,
    area: options.Area = options.DEFAULT.area,
    operator: options.Operator = options.DEFAULT.operator,
    components: options.Components = options.DEFAULT.components,
    root: options.Root = options.DEFAULT.root,
) -> None:
    """Skeleton and endpoint features of one mesh; of a mesh in several parts also the skeleton of each (in JSON).

    Exit code 0: described. 2: the mesh or an option was refused.
    """
    chosen_profile = options.profile(context, profile)
    check_target(json_out)
    kind = check_picture(picture)
    found = describe(mesh, chosen_profile)
    parts = found.part_skeletons()
    if json_out is not None:
        write_json(json_out, _to_json(found, parts))
    if picture is not None:
        from reebase.pictures import picture as draw

        write_bytes(picture, draw(found.denoised, found.skeleton, size=1024, format=kind, title=shown(mesh.name)))
    if json_out != STDOUT:
        _print(found, parts, shown(mesh.name))


def _graph(graph: Skeleton) -> dict[str, object]:
    return {
        "nodes": graph.positions.tolist(),
        "areas": graph.areas.tolist(),
        "bands": graph.bands.tolist(),
        "edges": graph.edges.tolist(),
        "joins": graph.joins.tolist(),
        "lengths": graph.lengths.tolist(),
        "endpoints": graph.endpoints.tolist(),
        "root": graph.root,
    }


def _to_json(found: Description, parts: list[Skeleton]) -> dict[str, object]:
    return {
        **_graph(found.skeleton),
        "parts": [_graph(part) for part in parts],
        "features": found.features.tolist(),
        "eigenvalues": found.eigenvalues.tolist(),
        "health": found.health.to_json(),
        "profile": found.profile.to_json(),
    }


def _print(found: Description, parts: list[Skeleton], name: str) -> None:
    out = results()
    health = found.health
    out.print(
        f"{name}: {counted(health.vertices, 'vertex')}, {counted(health.faces, 'face')}, "
        f"{counted(len(found.skeleton.endpoints), 'endpoint')}, {counted(found.skeleton.cycles, 'cycle')}"
    )
    for what, count in health.repairs.items():
        if count:
            out.print(f"  repaired: {what.replace('_', ' ')}: {count}")
    for explanation in health.to_json()["explanations"].values():
        out.print(f"  note: {explanation}")
    if parts:
        ends = ", ".join(str(len(part.endpoints)) for part in parts[:SHOWN]) + (", …" if len(parts) > SHOWN else "")
        apart = counted(int(found.skeleton.joins.sum()), "edge")
        out.print(f"  parts: {health.components}; endpoints of each by itself: {ends}; {apart} across gaps")
    rows = []
    for row, node in enumerate(found.skeleton.endpoints):
        # Where all paths are of length zero there are endpoints without features.
        omega = [f"{value:.4f}" for value in found.features[row]] if len(found.features) else ["-"] * 3
        rows.append((str(row), str(node), *omega))
    print_table(out, ("endpoint", "node", "relative area", "path lengths", "distance to root"), rows)
