"""`reebase evaluate`: precision-recall of a folder of labelled meshes, without a server."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from reebase.cli import options
from reebase.cli.describing import Outcome, Refusal, descriptions
from reebase.cli.folders import ABSENT, labels_of, mesh_files
from reebase.cli.output import (
    STDOUT,
    check_picture,
    check_target,
    notices,
    print_table,
    progress,
    results,
    shown,
    write_bytes,
    write_json,
)
from reebase.descriptors import DESCRIPTORS, descriptor_named
from reebase.errors import ParameterError
from reebase.evaluation import SCORES, Evaluation
from reebase.evaluation import evaluate as evaluate_matrix
from reebase.pipeline import Profile
from reebase.words import counted


def evaluate(
    folder: Annotated[Path, typer.Argument(help="A folder of mesh files; hidden ones are passed over.", metavar="DIR")],
    labels: options.Labels = None,
    descriptor: Annotated[str, typer.Option(help=f"What is compared: {', '.join(DESCRIPTORS)}.")] = "srg",
    measure: Annotated[
        str | None, typer.Option(help="How: for srg matching (the default), matching_mean, greedy or literal.")
    ] = None,
    json_out: options.JsonOut = None,
    matrix: Annotated[bool, typer.Option("--matrix", help="Put the dissimilarity matrix into the JSON.")] = False,
    plot: Annotated[Path | None, typer.Option(help="Draw the precision-recall curve here (.svg or .png).")] = None,
    bands: options.Bands = options.DEFAULT.bands,
    denoise: options.Denoise = options.DEFAULT.denoise,
    iterations: options.Iterations = options.DEFAULT.iterations,
    threshold: options.Threshold = options.DEFAULT.threshold,
    saliency: options.Saliency = options.DEFAULT.saliency,
    field: options.Field = options.DEFAULT.field,
    area: options.Area = options.DEFAULT.area,
    operator: options.Operator = options.DEFAULT.operator,
    bootstrap: Annotated[int, typer.Option(help="Resamples for the intervals; 0 for none.", min=0)] = 1000,
    jobs: Annotated[int, typer.Option(help="Processes; 0 for one a core.", min=0)] = 0,
) -> None:
    """Evaluate retrieval on a folder of labelled meshes, leave-one-out. Needs no service.

    Exit code 0: all labelled meshes took part. 1: some were left out, and a table says why; the report is of the
    others. 2: it could not run.
    """
    named = descriptor_named(descriptor)
    chosen = named.measure_named(measure)
    profile = Profile(denoise, iterations, field, bands, saliency, threshold, area, operator)
    check_target(json_out)
    kind = check_picture(plot, "svg")
    files = mesh_files(folder)
    found = labels_of(folder, files, labels)
    labelled = [path for path in files if path in found.of]
    if not any(count > 1 for count in Counter(found.of.values()).values()):
        raise ParameterError(
            f"There is nothing to evaluate in {folder}: no two meshes have the same label. "
            "Pass --labels, or sort the files into sub-folders."
        )
    names = {path: shown(path.relative_to(folder).as_posix()) for path in labelled}
    outcomes: dict[Path, Outcome] = {}
    with progress() as begin:
        step = begin("describing", len(labelled))
        for path, outcome in descriptions(labelled, profile, named.name, jobs):
            outcomes[path] = outcome
            step.update(len(outcomes))
        # In the order of the files, whoever was done first.
        features = {path: one for path in labelled if not isinstance(one := outcomes[path], Refusal)}
        if not features:
            raise ParameterError(f"None of the {len(labelled)} meshes could be described; {_first(outcomes)}")
        step = begin("comparing", 100)
        distances = named.distances(
            list(features.values()), chosen, progress=lambda fraction: step.update(int(100 * fraction))
        )
    report = evaluate_matrix(
        distances, [found.of[path] for path in features], [names[path] for path in features], bootstrap=bootstrap
    )
    failed = {names[path]: one for path, one in outcomes.items() if isinstance(one, Refusal)}
    failed |= {shown(name): Refusal("file_not_found", ABSENT) for name in found.absent}
    if json_out is not None:
        record = {
            "descriptor": named.name, "measure": chosen, "profile": profile.to_json(),
            "shapes": len(features), "without_label": len(files) - len(labelled),
            "failed": {name: {"code": one.code, "detail": one.detail} for name, one in sorted(failed.items())},
            **report.to_json(matrix=matrix),
        }  # fmt: skip
        write_json(json_out, record)
    if plot is not None:
        from reebase.pictures import precision_recall_plot

        curve = report.precision_recall
        curves = {f"{named.name}, {chosen}": (curve.recall, curve.precision)}
        write_bytes(plot, precision_recall_plot(curves, format=kind))
    if without := len(files) - len(labelled):
        notices().print(f"{counted(without, 'file')} {'has' if without == 1 else 'have'} no label and took no part.")
    if json_out != STDOUT:
        _print(report, failed)
    raise typer.Exit(1 if failed else 0)


def _first(outcomes: Mapping[Path, Outcome]) -> str:
    path, refusal = next((path, one) for path, one in outcomes.items() if isinstance(one, Refusal))
    return f"{shown(path.name)}: {refusal.detail} [{refusal.code}]"


def _print(report: Evaluation, failed: Mapping[str, Refusal]) -> None:
    out = results()
    record: dict[str, Any] = report.to_json()

    def scores(row: Mapping[str, float]) -> list[str]:
        return [f"{row[name]:.3f}" for name in SCORES]

    names = ("class", "shapes", *(name.replace("_", " ") for name in SCORES))
    rows = [(shown(label), str(row["count"]), *scores(row)) for label, row in record["per_class"].items()]
    means = [
        ("all queries", str(record["queries"]), *scores(record["overall"])),
        ("mean of classes", "", *scores(record["class_mean"])),
    ]
    print_table(out, names, rows, means)
    if failed:
        lost = [(name, one.code, shown(one.detail)) for name, one in sorted(failed.items())]
        print_table(out, ("left out", "code", "why"), lost)
