"""`reebase skeleton`: one mesh, its skeleton, a picture."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from reebase.cli import options
from reebase.pipeline import Description, Profile, describe


def skeleton(
    mesh: Annotated[Path, typer.Argument(help="A mesh file.", exists=True, dir_okay=False)],
    picture: Annotated[Path | None, typer.Option(help="Write a picture here (.png or .svg).")] = None,
    json_out: Annotated[Path | None, typer.Option("--json", help="Write the skeleton as JSON here.")] = None,
    bands: options.Bands = options.DEFAULT.bands,
    denoise: options.Denoise = options.DEFAULT.denoise,
    iterations: options.Iterations = options.DEFAULT.iterations,
    threshold: options.Threshold = options.DEFAULT.threshold,
    saliency: options.Saliency = options.DEFAULT.saliency,
    field: options.Field = options.DEFAULT.field,
    area: options.Area = options.DEFAULT.area,
) -> None:
    """Skeleton and endpoint features of one mesh."""
    profile = Profile(denoise, iterations, field, bands, saliency, threshold, area)
    found = describe(mesh, profile)
    if json_out is not None:
        json_out.write_text(json.dumps(_to_json(found)))
    if picture is not None:
        from reebase.pictures import picture as draw

        kind = picture.suffix[1:].lower() or "png"
        picture.write_bytes(draw(found.denoised, found.skeleton, size=1024, format=kind, title=mesh.name))
    _print(found, mesh.name)


def _to_json(found: Description) -> dict[str, object]:
    graph = found.skeleton
    return {
        "nodes": graph.positions.tolist(),
        "areas": graph.areas.tolist(),
        "bands": graph.bands.tolist(),
        "edges": graph.edges.tolist(),
        "lengths": graph.lengths.tolist(),
        "endpoints": graph.endpoints.tolist(),
        "root": graph.root,
        "features": found.features.tolist(),
        "eigenvalues": found.eigenvalues.tolist(),
        "health": found.health.to_json(),
        "profile": found.profile.to_json(),
    }


def _print(found: Description, name: str) -> None:
    console = Console()
    health = found.health
    console.print(
        f"[bold]{name}[/]: {health.vertices} vertices, {health.faces} faces, "
        f"{len(found.skeleton.endpoints)} endpoints, {found.skeleton.cycles} cycles"
    )
    for what, count in health.repairs.items():
        if count:
            console.print(f"  repaired: {what.replace('_', ' ')}: {count}")
    for explanation in health.to_json()["explanations"].values():
        console.print(f"  note: {explanation}")
    table = Table("endpoint", "node", "relative area", "path lengths", "distance to root")
    for row, (node, omega) in enumerate(zip(found.skeleton.endpoints, found.features, strict=False)):
        table.add_row(str(row), str(node), *(f"{value:.4f}" for value in omega))
    console.print(table)
