"""`reebase ingest`: a folder of meshes into a collection, over HTTP."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from reebase.cli import options
from reebase.cli.folders import labels_of, mesh_files
from reebase.cli.intake import TRANSIENT, Intake
from reebase.cli.output import STDOUT, check_target, notices, print_table, progress, results, shown, write_json
from reebase.client import Client, ServiceError, ServiceUnreachable
from reebase.words import counted

SHOWN = 10


def ingest(
    folder: Annotated[Path, typer.Argument(help="A folder of mesh files; hidden ones are passed over.", metavar="DIR")],
    collection: Annotated[str, typer.Option(help="The collection; it is made when it is not there.")],
    labels: options.Labels = None,
    parallel: Annotated[int, typer.Option(help="Uploads at the same time.", min=1, max=64)] = 4,
    wait: Annotated[bool, typer.Option(help="Wait until every shape is indexed or failed.")] = True,
    retry_failed: Annotated[
        bool, typer.Option(help="Try again what failed in an earlier run; of use where the cause may have passed.")
    ] = False,
    patience: Annotated[
        float, typer.Option(help="Seconds to go on trying when the service stops answering.", min=0)
    ] = 30.0,
    json_out: options.JsonOut = None,
    url: options.Url = options.URL,
    api_key: options.Key = None,
) -> None:
    """Upload a folder of meshes and wait until they are indexed.

    Run it again to go on where it stopped: what is there is skipped, and relabelled where its label has changed.
    Files of the same bytes are one shape.

    Exit code 0: all are indexed (with --no-wait: uploaded). 1: some are not, or a label names no file.
    2: it could not run, or the service was lost on the way. 130: Ctrl-C.
    """
    check_target(json_out)
    files = mesh_files(folder)
    named = labels_of(folder, files, labels)
    with Client(url, api_key=api_key, patience=0) as probe:
        limits = probe.limits()
    with Client(url, api_key=api_key, patience=patience) as client:
        client.create_collection(collection, exist_ok=True)
        work = Intake(client, collection, folder, named.of, limits, retry_failed)
        try:
            with progress() as begin:
                work.read(files, begin)
                work.upload(parallel, begin)
                if wait:
                    work.settle(begin, lambda text: notices().print(text))
        except (ServiceUnreachable, ServiceError, KeyboardInterrupt) as stop:
            _say_stopped(work, stop)
            raise
        summary = {**work.summary(wait), "labels_without_file": [shown(name) for name in named.absent]}
    if json_out is not None:
        write_json(json_out, summary)
    if json_out != STDOUT:
        _print(summary, retried=retry_failed)
    raise typer.Exit(1 if work.failures or named.absent else 0)


def _say_stopped(work: Intake, stop: BaseException) -> None:
    why = {ServiceUnreachable: "The service was lost", ServiceError: "The service refuses to go on"}
    done, total = work.uploaded + work.skipped, len(work.same)
    notices().print(
        f"{why.get(type(stop), 'Stopped')}: at least {done} of {total} shapes are in the collection. "
        "Run the same command again to go on."
    )


def _print(summary: dict[str, Any], *, retried: bool) -> None:
    out = results()
    state = f"{summary['indexed']} indexed" if summary["waited"] else "indexing goes on in the background"
    relabelled = f" ({summary['relabelled']} relabelled)" if summary["relabelled"] else ""
    out.print(
        f"{counted(summary['files'], 'file')}, {counted(summary['shapes'], 'shape')}: {summary['uploaded']} uploaded, "
        f"{summary['skipped']} there already{relabelled}; {state}, {len(summary['failed'])} failed."
    )
    if number := summary["without_label"]:
        out.print(f"  {counted(number, 'file')} {'has' if number == 1 else 'have'} no label")
    if absent := summary["labels_without_file"]:
        more = f" and {len(absent) - SHOWN} more" if len(absent) > SHOWN else ""
        names = f"{', '.join(absent[:SHOWN])}{more}"
        out.print(f"  {counted(len(absent), 'label')} {'names' if len(absent) == 1 else 'name'} no file: {names}")
    for copy in summary["copies"][:SHOWN]:
        out.print(f"  {copy['file']} has the same bytes as {copy['same_as']}: one shape")
    if len(summary["copies"]) > SHOWN:
        out.print(f"  ... and {len(summary['copies']) - SHOWN} more copies; --json lists them all")
    for conflict in summary["label_conflicts"]:
        out.print(
            f"  {conflict['file']} is labelled {' and '.join(conflict['labels'])} by its copies; "
            f"the shape is labelled {conflict['labels'][0]}"
        )
    if summary["failed"]:
        rows = [(failure["file"], failure["code"], shown(failure["detail"])) for failure in summary["failed"]]
        print_table(out, ("file", "code", "why"), rows)
        passing = sorted({failure["code"] for failure in summary["failed"]} & TRANSIENT)
        if passing and not retried:
            out.print(f"{' and '.join(passing)} may have passed: --retry-failed tries again.")
