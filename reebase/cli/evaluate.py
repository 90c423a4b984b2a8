"""`reebase evaluate`: precision-recall of a folder of labelled meshes, without a server."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from reebase.cli import options
from reebase.cli.describing import Kept, Outcome, Refusal, descriptions
from reebase.cli.folders import ABSENT, labels_of, mesh_files
from reebase.cli.output import (
    STDOUT,
    Steps,
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
from reebase.cli.reporting import check_report, cost_of, report_of, write_report
from reebase.descriptors import DESCRIPTORS, descriptor_named
from reebase.errors import ParameterError
from reebase.evaluation import SCORES
from reebase.evaluation import evaluate as evaluate_matrix
from reebase.pipeline import Profile
from reebase.ranking import DEFAULT, FUSED, RANKINGS, Ranking, ranking_named
from reebase.report.record import Entry
from reebase.words import counted

ALL = "all"
"""Stands for every descriptor that compares whole shapes: a part that seeks its whole is another question."""

THESIS, SRG = "thesis", "srg"
"""A profile, and what ranks with it."""


def evaluate(
    context: typer.Context,
    folder: Annotated[Path, typer.Argument(help="A folder of mesh files; hidden ones are passed over.", metavar="DIR")],
    labels: options.Labels = None,
    descriptor: Annotated[
        list[str] | None,
        typer.Option(
            help=f"What ranks, may be repeated: {', '.join(RANKINGS)}, or {ALL}. [default: {DEFAULT}; {THESIS}: {SRG}]"
        ),
    ] = None,
    measure: Annotated[
        str | None,
        typer.Option(help="How: for srg, which a measure alone means, matching, matching_mean, greedy or literal."),
    ] = None,
    rerank: Annotated[
        bool | None, typer.Option(help="Whether fused is re-ranked by diffusion: the default, and both with all.")
    ] = None,
    json_out: options.JsonOut = None,
    matrix: Annotated[bool, typer.Option("--matrix", help="Put the dissimilarity matrix into the JSON.")] = False,
    plot: Annotated[Path | None, typer.Option(help="Draw the precision-recall curve here (.svg or .png).")] = None,
    report_out: Annotated[
        Path | None,
        typer.Option(
            "--report", metavar="OUT",
            help="Write a report to this folder: index.html, which any browser shows, report.json and the plots.",
        ),
    ] = None,
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
    bootstrap: Annotated[int, typer.Option(help="Resamples for the intervals; 0 for none.", min=0)] = 1000,
    jobs: Annotated[int, typer.Option(help="Processes; 0 for one a core.", min=0)] = 0,
) -> None:
    """Evaluate retrieval on a folder of labelled meshes, leave-one-out. Needs no service.

    Exit code 0: all labelled meshes took part. 1: some were left out, and a table says why; the report is of the
    others. 2: it could not run.
    """
    # The thesis ranks by its own D: of what else ranks by default its parameters change nothing.
    default = SRG if profile == THESIS else ranking_named(None, measure).name
    chosen = _chosen(descriptor or [default], measure, rerank)
    chosen_profile = options.profile(context, profile)
    check_target(json_out)
    kind = check_picture(plot, "svg")
    check_report(report_out)
    files = mesh_files(folder)
    found = labels_of(folder, files, labels)
    labelled = [path for path in files if path in found.of]
    if not any(count > 1 for count in Counter(found.of.values()).values()):
        raise ParameterError(
            f"There is nothing to evaluate in {folder}: no two meshes have the same label. "
            "Pass --labels, or sort the files into sub-folders."
        )
    names = {path: shown(path.relative_to(folder).as_posix()) for path in labelled}
    with progress() as begin:
        parts = list(dict.fromkeys(part for one in chosen for part in one.parts))
        outcomes = _described(labelled, chosen_profile, parts, jobs, begin)
        kept = {path: one for path, one in outcomes.items() if isinstance(one, Kept)}
        entries = _compared(kept, chosen, [found.of[path] for path in kept], [names[path] for path in kept],
                            bootstrap, begin)  # fmt: skip
        failed = {names[path]: one for path, one in outcomes.items() if isinstance(one, Refusal)}
        failed |= {shown(name): Refusal("file_not_found", ABSENT) for name in found.absent}
        without = len(files) - len(labelled)
        if report_out is not None:
            facts = _facts(chosen_profile, len(kept), without)
            report = report_of(folder, entries, kept, {names[path]: path for path in kept}, facts, failed, begin)
            write_report(report, report_out, begin)
    if json_out is not None:
        common = {
            "profile": chosen_profile.to_json(), "shapes": len(kept), "without_label": without,
            "failed": {name: {"code": one.code, "detail": one.detail} for name, one in sorted(failed.items())},
        }  # fmt: skip
        write_json(json_out, _record(common, entries, matrix))
    if plot is not None:
        from reebase.pictures import precision_recall_plot

        curves = {
            ", ".join(filter(None, (one.name, one.measure))): (one.evaluation.precision_recall.recall,
                                           one.evaluation.precision_recall.precision)
            for one in entries
        }  # fmt: skip
        write_bytes(plot, precision_recall_plot(curves, format=kind))
    if without:
        notices().print(f"{counted(without, 'file')} {'has' if without == 1 else 'have'} no label and took no part.")
    if json_out != STDOUT:
        _print(entries, failed)
    raise typer.Exit(1 if failed else 0)


def _chosen(names: Sequence[str], measure: str | None, rerank: bool | None) -> list[Ranking]:
    """What ranks, each once and in the order given. Raises UnknownName, ParameterError."""
    found: list[Ranking] = []
    for name in names:
        if name == ALL:
            both = (True, False) if rerank is None else (rerank,)
            found += [ranking_named(FUSED, measure, one) for one in both]
            found += [
                ranking_named(name, measure) for name, one in DESCRIPTORS.items()
                if one.measures[0] not in one.comparison.one_sided
            ]  # fmt: skip
        else:
            found.append(ranking_named(name, measure, rerank))
    return list(dict.fromkeys(found))


def _described(
    files: Sequence[Path], profile: Profile, descriptors: Sequence[str], jobs: int, begin: Steps
) -> dict[Path, Outcome]:
    """The outcome of each file, in their order, whoever was done first. Raises ParameterError when none is good."""
    outcomes: dict[Path, Outcome] = {}
    step = begin("describing", len(files))
    for path, outcome in descriptions(files, profile, descriptors, jobs):
        outcomes[path] = outcome
        step.update(len(outcomes))
    refusals = [(path, one) for path, one in outcomes.items() if isinstance(one, Refusal)]
    if len(refusals) == len(files):
        path, first = refusals[0]
        raise ParameterError(
            f"None of the {len(files)} meshes could be described; {shown(path.name)}: {first.detail} [{first.code}]"
        )
    return {path: outcomes[path] for path in files}


def _compared(
    kept: Mapping[Path, Kept], chosen: Sequence[Ranking], labels: Sequence[str], names: Sequence[str],
    bootstrap: int, begin: Steps,
) -> list[Entry]:  # fmt: skip
    """The evaluation of each ranking; what several of them compare is compared once."""
    pairs = list(dict.fromkeys(pair for one in chosen for pair in one.parts.items()))
    step = begin("comparing", 100 * len(pairs))
    distances = {}
    for number, (part, measure) in enumerate(pairs):
        def tell(fraction: float, done: int = 100 * number) -> None:
            step.update(done + int(100 * fraction))

        arrays = [shape.arrays[part] for shape in kept.values()]
        distances[part, measure] = descriptor_named(part).distances(arrays, measure, progress=tell)
        tell(1.0)
    entries = []
    for one in chosen:
        matrix = one.combined({part: distances[part, measure] for part, measure in one.parts.items()})
        name = f"{one.name}, re-ranked" if one.rerank else one.name
        summary = DESCRIPTORS[one.name].summary if one.name in DESCRIPTORS else f"Fused: {', '.join(one.parts)}."
        found = evaluate_matrix(matrix, labels, names, bootstrap=bootstrap)
        entries.append(Entry(name, one.measure, found, summary, cost_of(one.parts, kept.values())))
    return entries


def _facts(profile: Profile, shapes: int, without: int) -> dict[str, str]:
    filtered = profile.denoise if profile.denoise == "none" else f"{profile.denoise} × {profile.iterations}"
    facts = {
        "Shapes": f"{shapes} with a label" + (f", {without} without one took no part" if without else ""),
        "Denoising": filtered,
        "Skeleton": f"field {profile.field}, {profile.bands} bands of equal {profile.levels}, "
        f"{profile.saliency} below {profile.threshold:g} pruned, node area by {profile.area}, "
        f"root at the {profile.root}",
        "Operator": profile.operator,
        "Parts": "joined where they are nearest" if profile.components == "joined" else "the largest alone",
    }
    return facts


def _record(common: dict[str, Any], entries: Sequence[Entry], matrix: bool) -> dict[str, Any]:
    """One descriptor: its record. Several: by name under ``descriptors``."""
    own = {
        one.name: {"measure": one.measure, **one.evaluation.to_json(matrix=matrix)} for one in entries
    }
    if len(own) > 1:
        return {**common, "descriptors": own}
    return {"descriptor": entries[0].name, **common, **own[entries[0].name]}


def _print(entries: Sequence[Entry], failed: Mapping[str, Refusal]) -> None:
    """Classes and means of one descriptor; of several, the mean over the queries of each."""
    out = results()

    def scores(row: Mapping[str, float]) -> list[str]:
        return [f"{row[name]:.3f}" for name in SCORES]

    heads = [name.replace("_", " ") for name in SCORES]
    if len(entries) > 1:
        print_table(out, ("descriptor", "measure", *heads),
                    [(one.name, one.measure or "", *scores(one.evaluation.overall)) for one in entries])  # fmt: skip
    else:
        found = entries[0].evaluation
        rows = [(shown(label), str(found.counts[label]), *scores(means)) for label, means in found.per_class.items()]
        means = [
            ("all queries", str(len(found.queries)), *scores(found.overall)),
            ("mean of classes", "", *scores(found.class_mean)),
        ]
        out.print(f"By {entries[0].name}{f', {entries[0].measure}' if entries[0].measure else ''}:")
        print_table(out, ("class", "shapes", *heads), rows, means)
    if failed:
        lost = [(name, one.code, shown(one.detail)) for name, one in sorted(failed.items())]
        print_table(out, ("left out", "code", "why"), lost)
