"""`reebase query`: which shapes of a collection are like this mesh?"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from reebase.cli import options
from reebase.cli.output import STDOUT, check_target, print_table, results, write_json
from reebase.client import Answer, Client
from reebase.words import counted


def query(
    mesh: Annotated[Path, typer.Argument(help="A mesh file; it is not kept.", exists=True, dir_okay=False)],
    collection: Annotated[str, typer.Option(help="The collection to search.")],
    k: Annotated[int, typer.Option("--k", "-k", help="How many shapes to return.", min=1)] = 10,
    tolerance: Annotated[
        str, typer.Option(help="By how much endpoint counts may differ: a whole number, or any.", metavar="N|any")
    ] = "2",
    measure: options.Measure = "matching",
    label: Annotated[str | None, typer.Option(help="Only shapes with this label.")] = None,
    tag: Annotated[list[str] | None, typer.Option(help="Only shapes with this tag; may be repeated.")] = None,
    max_dissimilarity: Annotated[float | None, typer.Option(help="Only hits at most so far.", min=0)] = None,
    json_out: options.JsonOut = None,
    url: options.Url = options.URL,
    api_key: options.Key = None,
) -> None:
    """Rank a collection of the service by its similarity to a mesh.

    Exit code 0: answered, with or without hits. 2: it could not run, or was refused.
    """
    check_target(json_out)
    most = _tolerance(tolerance)
    with Client(url, api_key=api_key, patience=2.0) as client:
        answer = client.query(
            collection, source=mesh, k=k, tolerance=most, measure=measure,
            label=label, tags=tag or (), max_dissimilarity=max_dissimilarity,
        )  # fmt: skip
    if json_out is not None:
        write_json(json_out, asdict(answer))
    if json_out != STDOUT:
        print_answer(answer, results())


def _tolerance(text: str) -> int | None:
    if text in ("any", "-1"):
        return None
    if not (text.isascii() and text.isdecimal()):
        raise typer.BadParameter(f"{text!r} is neither a whole number nor any.", param_hint="--tolerance")
    return int(text)


def print_answer(answer: Answer, console: Console) -> None:
    """The hits as a table: D, and what it is made of."""
    endpoints = answer.query["endpoint_count"]
    console.print(f"{counted(endpoints, 'endpoint')}; {counted(answer.considered, 'shape')} considered")
    if not answer.hits:
        console.print("No hits: nothing indexed passes the filters within the tolerance; --tolerance any takes all.")
        return
    rows = []
    for hit in answer.hits:
        pairs = "  ".join(f"{pair.query}-{pair.hit}: {pair.distance:.3f}" for pair in hit.pairs)
        alone = [f"query {one.endpoint}: {one.charge:.3f}" for one in hit.unmatched_query]
        alone += [f"hit {one.endpoint}: {one.charge:.3f}" for one in hit.unmatched_hit]
        rows.append((
            str(hit.rank), hit.shape.name, hit.shape.label or "", f"{hit.dissimilarity:.4f}",
            str(hit.endpoint_count), pairs, "  ".join(alone),
        ))  # fmt: skip
    names = ("rank", "shape", "label", "D(G, G~)", "endpoints", "matched pairs (query-hit: distance)", "unmatched")
    print_table(console, names, rows, widest=1)
