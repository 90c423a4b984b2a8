"""`reebase ingest`: a folder of meshes into a collection, over HTTP."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from reebase.cli import options
from reebase.cli.folders import ABSENT, labels_of, mesh_files
from reebase.cli.intake import Failure, Intake
from reebase.cli.output import STDOUT, check_target, notices, progress, results, shown, write_json
from reebase.client import Client, ServiceError, ServiceUnreachable

SHOWN_COPIES = 10


def ingest(
    folder: Annotated[Path, typer.Argument(help="A folder of mesh files; hidden ones are passed over.", metavar="DIR")],
    collection: Annotated[str, typer.Option(help="The collection; it is made when it is not there.")],
    labels: options.Labels = None,
    parallel: Annotated[int, typer.Option(help="Uploads at the same time.", min=1, max=64)] = 4,
    wait: Annotated[bool, typer.Option(help="Wait until every shape is indexed or failed.")] = True,
    retry_failed: Annotated[bool, typer.Option(help="Try again what failed in an earlier run.")] = False,
    patience: Annotated[
        float, typer.Option(help="Seconds to go on trying when the service stops answering.", min=0)
    ] = 30.0,
    json_out: options.JsonOut = None,
    url: options.Url = options.URL,
    api_key: options.Key = None,
) -> None:
    """Upload a folder of meshes and wait until they are indexed.

    Run it again to go on where it stopped: what is there is skipped. Files of the same bytes are one shape.

    Exit code 0: all are indexed (with --no-wait: uploaded). 1: some are not, and a table says why.
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
        work.failures += [Failure(shown(name), "file_not_found", ABSENT) for name in named.absent]
        summary = work.summary(wait)
    if json_out is not None:
        write_json(json_out, summary)
    if json_out != STDOUT:
        _print(summary)
    raise typer.Exit(1 if work.failures else 0)


def _say_stopped(work: Intake, stop: BaseException) -> None:
    why = {ServiceUnreachable: "The service was lost", ServiceError: "The service refuses to go on"}
    done, total = work.uploaded + work.skipped, len(work.same)
    notices().print(
        f"{why.get(type(stop), 'Stopped')}: {done} of {total} shapes are in the collection. "
        "Run the same command again to go on."
    )


def _print(summary: dict[str, Any]) -> None:
    out = results()
    state = f"{summary['indexed']} indexed" if summary["waited"] else "indexing goes on in the background"
    out.print(
        f"{summary['files']} files, {summary['shapes']} shapes: {summary['uploaded']} uploaded, "
        f"{summary['skipped']} there already; {state}, {len(summary['failed'])} failed."
    )
    for copy in summary["copies"][:SHOWN_COPIES]:
        out.print(f"  {copy['file']} has the same bytes as {copy['same_as']}: one shape")
    if len(summary["copies"]) > SHOWN_COPIES:
        out.print(f"  ... and {len(summary['copies']) - SHOWN_COPIES} more copies; --json lists them all")
    for conflict in summary["label_conflicts"]:
        out.print(
            f"  {conflict['file']} is labelled {' and '.join(conflict['labels'])} by its copies; "
            f"the shape is labelled {conflict['labels'][0]}"
        )
    if summary["failed"]:
        table = Table("file", "code", "why")
        for failure in summary["failed"]:
            table.add_row(failure["file"], failure["code"], failure["detail"])
        out.print(table)
