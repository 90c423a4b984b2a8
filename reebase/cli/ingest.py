"""`reebase ingest`: a folder of meshes into a collection, over HTTP."""

from __future__ import annotations

import hashlib
import time
from collections import defaultdict
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from reebase.cli import options
from reebase.cli.folders import labels_of, mesh_files
from reebase.client import Client, Shape
from reebase.errors import ReebaseError

SETTLED = ("indexed", "failed", "cancelled")


@dataclass(frozen=True)
class Failure:
    """A file that did not become an indexed shape, and why."""

    file: str
    code: str
    detail: str


def ingest(
    folder: Annotated[Path, typer.Argument(help="A folder of mesh files.", metavar="DIR")],
    collection: Annotated[str, typer.Option(help="The collection; it is made when it is not there.")],
    labels: Annotated[
        Path | None, typer.Option(help="CSV with the columns file, label; by default DIR/labels.csv or sub-folders.")
    ] = None,
    parallel: Annotated[int, typer.Option(help="Uploads at the same time.", min=1, max=64)] = 4,
    wait: Annotated[bool, typer.Option(help="Wait until every shape is indexed or failed.")] = True,
    retry_failed: Annotated[bool, typer.Option(help="Try again what failed in an earlier run.")] = False,
    url: options.Url = "http://127.0.0.1:8000",
    api_key: options.Key = None,
) -> None:
    """Upload a folder of meshes; run it again to go on where it stopped. Exit code 1 when a file failed."""
    console = Console(stderr=True)
    files = mesh_files(folder)
    label_of = labels_of(folder, labels)
    with Client(url, api_key=api_key) as client, Progress(console=console) as progress:
        client.create_collection(collection, exist_ok=True)
        there = _stored(client, collection)
        same = _by_content(progress.track(files, description="reading"))
        names = {sha256: str(paths[0].relative_to(folder)) for sha256, paths in same.items()}
        refused: list[Failure] = []
        bar = progress.add_task("uploading", total=len(same))

        def send(sha256: str) -> None:
            path = same[sha256][0]
            label = next((label_of[p] for p in same[sha256] if p in label_of), None)
            known = there.get(sha256)
            if known is None:
                client.upload(collection, path, name=names[sha256], label=label)
                return
            if label is not None and known.label != label:
                client.update_shape(collection, known.id, label=label)
            if retry_failed and known.state in ("failed", "cancelled"):
                client.retry_shape(collection, known.id)

        with ThreadPoolExecutor(parallel) as pool:
            running = {pool.submit(send, sha256): sha256 for sha256 in same}
            for done in as_completed(running):
                try:
                    done.result()
                except ReebaseError as refusal:
                    refused.append(Failure(names[running[done]], refusal.code, refusal.message))
                progress.advance(bar)
        missing = {failure.file for failure in refused}
        wanted = {sha256 for sha256, name in names.items() if name not in missing}
        shapes = _settle(client, collection, wanted, progress) if wait else {}
    failures = refused + [
        _failure(names[sha256], shape)
        for sha256, shape in shapes.items()
        if shape.state != "indexed"
    ]
    skipped = sum(1 for sha256 in same if sha256 in there)
    _print(files, same, shapes, skipped, failures)
    raise typer.Exit(1 if failures else 0)


def _failure(file: str, shape: Shape) -> Failure:
    reason = shape.error or {}
    return Failure(file, str(reason.get("code", shape.state)), str(reason.get("detail", "")))


def _by_content(files: Iterable[Path]) -> dict[str, list[Path]]:
    """The files of each content: files of the same bytes are one shape."""
    found: dict[str, list[Path]] = defaultdict(list)
    for path in files:
        with path.open("rb") as opened:
            found[hashlib.file_digest(opened, "sha256").hexdigest()].append(path)
    return dict(found)


def _stored(client: Client, collection: str) -> dict[str, Shape]:
    """The shapes that are there, by the hash of their bytes."""
    return {shape.sha256: shape for shape in client.shapes(collection)}


def _settle(client: Client, collection: str, wanted: set[str], progress: Progress) -> dict[str, Shape]:
    """Wait until no wanted shape is queued or running; sha256 -> shape."""
    bar = progress.add_task("indexing", total=len(wanted))
    while True:
        shapes = {sha256: s for sha256, s in _stored(client, collection).items() if sha256 in wanted}
        settled = sum(1 for shape in shapes.values() if shape.state in SETTLED)
        progress.update(bar, completed=settled + len(wanted) - len(shapes))
        if settled == len(shapes):
            return shapes
        time.sleep(min(1.0, 0.2 + len(wanted) / 2000))


def _print(
    files: list[Path], same: dict[str, list[Path]], shapes: dict[str, Shape], skipped: int, failures: list[Failure]
) -> None:
    console = Console()
    indexed = sum(1 for shape in shapes.values() if shape.state == "indexed")
    copies = len(files) - len(same)
    console.print(
        f"{len(files)} files: {indexed} shapes indexed, {skipped} of them were there already, "
        f"{copies} files were copies of another, {len(failures)} failed"
    )
    for paths in same.values():
        for copy in paths[1:]:
            console.print(f"  {copy.name} has the same bytes as {paths[0].name}: one shape")
    if failures:
        table = Table("file", "code", "why")
        for failure in sorted(failures, key=lambda one: one.file):
            table.add_row(failure.file, failure.code, failure.detail)
        console.print(table)
