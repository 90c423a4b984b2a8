"""`reebase evaluate`: precision-recall of a folder of labelled meshes, without a server."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated

import numpy as np
import numpy.typing as npt
import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Column, Table

from reebase.cli import options
from reebase.cli.folders import labels_of, mesh_files
from reebase.descriptors import descriptor_named
from reebase.errors import ParameterError, ReebaseError
from reebase.evaluation.matrix import dissimilarity_matrix
from reebase.evaluation.measures import Evaluation
from reebase.evaluation.measures import evaluate as evaluate_matrix
from reebase.pipeline import Profile, describe

Features = npt.NDArray[np.float64]


def evaluate(
    folder: Annotated[Path, typer.Argument(help="A folder of mesh files.", metavar="DIR")],
    labels: Annotated[
        Path | None, typer.Option(help="CSV with the columns file, label; by default DIR/labels.csv or sub-folders.")
    ] = None,
    descriptor: Annotated[str, typer.Option(help="What is compared.")] = "srg",
    measure: options.Measure = "matching",
    json_out: Annotated[Path | None, typer.Option("--json", help="Write the report as JSON here.")] = None,
    matrix: Annotated[bool, typer.Option(help="Put the dissimilarity matrix into the JSON.")] = False,
    plot: Annotated[Path | None, typer.Option(help="Draw the precision-recall curve here (.svg or .png).")] = None,
    bands: options.Bands = options.DEFAULT.bands,
    denoise: options.Denoise = options.DEFAULT.denoise,
    iterations: options.Iterations = options.DEFAULT.iterations,
    threshold: options.Threshold = options.DEFAULT.threshold,
    saliency: options.Saliency = options.DEFAULT.saliency,
    field: options.Field = options.DEFAULT.field,
    area: options.Area = options.DEFAULT.area,
    bootstrap: Annotated[int, typer.Option(help="Resamples for the intervals; 0 for none.", min=0)] = 1000,
    jobs: Annotated[int, typer.Option(help="Processes; 0 for one a core.", min=0)] = 0,
) -> None:
    """Evaluate retrieval on a folder of labelled meshes (leave-one-out)."""
    console = Console(stderr=True)
    named = descriptor_named(descriptor)
    label_of = labels_of(folder, labels)
    if not label_of:
        raise ParameterError(f"No file of {folder} has a label: pass --labels, or sort the files into sub-folders.")
    files = [path for path in mesh_files(folder) if path in label_of]
    profile = Profile(denoise, iterations, field, bands, saliency, threshold, area)
    found: dict[Path, Features] = {}
    failed: dict[str, dict[str, str]] = {}
    with Progress(console=console, transient=True) as progress:
        bar = progress.add_task("describing", total=len(files))
        for path, outcome in _descriptions(files, profile, jobs):
            if isinstance(outcome, ReebaseError):
                failed[str(path.relative_to(folder))] = {"code": outcome.code, "detail": outcome.message}
            else:
                found[path] = outcome
            progress.advance(bar)
    kept = [path for path in files if path in found]
    if not kept:
        raise ParameterError(f"None of the {len(files)} meshes of {folder} could be described.")
    distances = dissimilarity_matrix([found[path] for path in kept], measure)
    ids = [str(path.relative_to(folder)) for path in kept]
    report = evaluate_matrix(distances, [label_of[path] for path in kept], ids, bootstrap=bootstrap)
    if json_out is not None:
        record = {
            "descriptor": named.name, "measure": measure, "profile": profile.to_json(), "failed": failed,
            **report.to_json(matrix=matrix),
        }  # fmt: skip
        json_out.write_text(json.dumps(record))
    if plot is not None:
        from reebase.pictures import precision_recall_plot

        curve = report.precision_recall
        kind = plot.suffix[1:].lower() or "svg"
        curves = {f"{descriptor}, {measure}": (curve.recall, curve.precision)}
        plot.write_bytes(precision_recall_plot(curves, format=kind))
    _print(report, failed)


def _describe(path: Path, profile: Profile) -> Features | ReebaseError:
    try:
        return describe(path, profile).features
    except ReebaseError as refusal:
        return refusal


def _descriptions(
    files: list[Path], profile: Profile, jobs: int
) -> Iterator[tuple[Path, Features | ReebaseError]]:
    """Each file with its features, or with why there are none, as they are done."""
    workers = min(jobs or os.cpu_count() or 1, len(files))
    if workers == 1:
        yield from ((path, _describe(path, profile)) for path in files)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        running = {pool.submit(_describe, path, profile): path for path in files}
        for done in as_completed(running):
            yield running[done], done.result()


def _print(report: Evaluation, failed: dict[str, dict[str, str]]) -> None:
    console = Console()
    names = ("nn", "first_tier", "second_tier", "e_measure", "map", "dcg")
    record = report.to_json()
    table = Table(Column("class", no_wrap=True), "shapes", *(name.replace("_", " ") for name in names))
    for label, row in record["per_class"].items():
        table.add_row(label, str(row["count"]), *(f"{row[name]:.3f}" for name in names))
    table.add_section()
    table.add_row("all queries", str(record["queries"]), *(f"{record['overall'][name]:.3f}" for name in names))
    table.add_row("mean of classes", "", *(f"{record['class_mean'][name]:.3f}" for name in names))
    console.print(table)
    for file, reason in failed.items():
        console.print(f"[red]left out[/] {file}: {reason['detail']} [{reason['code']}]", markup=True)
