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
from reebase.ranking import DEFAULT, RANKINGS, ranking_named
from reebase.words import counted


def query(
    mesh: Annotated[Path, typer.Argument(help="A mesh file; it is not kept.", exists=True, dir_okay=False)],
    collection: Annotated[str, typer.Option(help="The collection to search.")],
    k: Annotated[int, typer.Option("--k", "-k", help="How many shapes to return.", min=1)] = 10,
    descriptor: Annotated[
        str | None, typer.Option(help=f"What ranks: {', '.join(RANKINGS)}. [default: {DEFAULT}]")
    ] = None,
    measure: Annotated[
        str | None,
        typer.Option(help="How that is compared: for srg matching (its default), matching_mean, greedy or literal."),
    ] = None,
    rerank: Annotated[
        bool | None, typer.Option("--rerank/--no-rerank", help="Refine fused by nearest neighbours. [default: rerank]")
    ] = None,
    tolerance: Annotated[
        str | None,
        typer.Option(
            help="By how much endpoint counts may differ: a whole number, or any. [default: 2 for srg, else any]",
            metavar="N|any",
        ),
    ] = None,
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
    ranking_named(descriptor, measure, rerank)
    most = ... if tolerance is None else _tolerance(tolerance)
    with Client(url, api_key=api_key, patience=2.0) as client:
        answer = client.query(
            collection, source=mesh, k=k, descriptor=descriptor, measure=measure, rerank=rerank, tolerance=most,
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
    """The hits as a table: what ranks, what each part says and its share; D, and what it is made of."""
    endpoints, name = answer.query["endpoint_count"], answer.query["descriptor"]
    how = answer.query["measure"] or ("re-ranked" if answer.query["rerank"] else "as it is")
    console.print(
        f"{counted(endpoints, 'endpoint')}; {counted(answer.considered, 'shape')} considered, by {name}, {how}"
    )
    for one in answer.left_out:
        console.print(f"{counted(one['shapes'], 'shape')} left out. {one['detail']}")
    if not answer.hits:
        console.print("No hits: nothing indexed passes the filters within the tolerance; --tolerance any takes all.")
        return
    rows, ranked_by_d = [], name == "srg"
    for hit in answer.hits:
        pairs = "  ".join(f"{pair.query}-{pair.hit}: {pair.distance:.3f}" for pair in hit.pairs)
        alone = [f"query {one.endpoint}: {one.charge:.3f}" for one in hit.unmatched_query]
        alone += [f"hit {one.endpoint}: {one.charge:.3f}" for one in hit.unmatched_hit]
        start = (str(hit.rank), hit.shape.name, hit.shape.label or "")
        D = f"{hit.graph_dissimilarity:.4f}"
        if ranked_by_d:
            rows.append((*start, D, str(hit.endpoint_count), pairs, "  ".join(alone)))
        else:
            parts = "  ".join(f"{one.descriptor} {one.dissimilarity:.3f} ({one.share:.0%})" for one in hit.parts)
            rows.append((*start, f"{hit.dissimilarity:.4f}", parts, D, str(hit.endpoint_count)))
    own = ("D(G, G~)", "endpoints")
    reasons = (*own, "matched pairs (query-hit: distance)", "unmatched")
    names = ("rank", "shape", "label", *(reasons if ranked_by_d else (name, "parts (share)", *own)))
    print_table(console, names, rows, widest=1)
