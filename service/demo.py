"""`reebase demo`: a collection of synthetic shapes, and a query with its reasons as a table and a picture."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from reebase.cli import options
from reebase.cli.query import print_answer
from reebase.client import Answer, Client
from reebase.errors import ComputationError
from store.settings import Settings

START_SECONDS = 60.0
HITS = 9


def demo(
    url: Annotated[
        str | None, typer.Option(help="A running service; by default one is started for the time of the demo.")
    ] = None,
    collection: Annotated[str, typer.Option(help="The collection to fill.")] = "demo",
    per_class: Annotated[int, typer.Option(help="Shapes of each of the ten classes.", min=2, max=200)] = 25,
    seed: Annotated[int, typer.Option(help="The same seed gives the same shapes.", min=0)] = 0,
    query: Annotated[str, typer.Option(help="Name of the shape to query with.")] = "humans-00",
    picture: Annotated[Path | None, typer.Option(help="Where to write the picture (.png or .svg).")] = None,
    api_key: options.Key = None,
) -> None:
    """Fill a collection with the synthetic set, query it, and show the answer with its reasons."""
    console = Console()
    target = picture or Settings().home / "demo.png"
    with _service(url, console) as address, Client(address, api_key=api_key) as client:
        _fill(client, collection, per_class, seed, console)
        shapes = {shape.name: shape.id for shape in client.shapes(collection)}
        if query not in shapes:
            raise typer.BadParameter(f"there is no shape named {query}; try {next(iter(shapes))}.")
        answer = client.query(collection, shape=shapes[query], k=HITS)
        console.print(f"\n[bold]Which shapes of {collection} are like {query}?[/]")
        print_answer(answer, console)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(_draw(client, collection, query, shapes[query], answer, target.suffix[1:] or "png"))
        console.print(f"The query and its hits, with their skeletons: {target}")
        if url is None:
            console.print(f"The collection {collection!r} is kept: see it with ./run serve.")


@contextmanager
def _service(url: str | None, console: Console) -> Iterator[str]:
    """The service at ``url``, or one of our own on a free port, stopped afterwards."""
    if url is not None:
        yield url
        return
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
    address = f"http://127.0.0.1:{port}"
    log = Settings().home / "demo.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("wb") as output:
        command = [sys.executable, "-m", "service", "serve", "--port", str(port), "--workers", str(os.cpu_count() or 1)]
        server = subprocess.Popen(command, stdout=output, stderr=output)  # noqa: S603 - our own module
        try:
            with console.status("starting the service"), Client(address) as client:
                end = time.monotonic() + START_SECONDS
                while not client.ready():
                    if server.poll() is not None or time.monotonic() > end:
                        raise ComputationError(f"The service did not start; {log} says why.")
                    time.sleep(0.1)
            yield address
        finally:
            server.send_signal(signal.SIGTERM)
            server.wait()


def _fill(client: Client, collection: str, per_class: int, seed: int, console: Console) -> None:
    """Upload what is not there yet, and wait until all of it is described."""
    from reebase.evaluation.synthetic import CLASSES, synthetic_set

    client.create_collection(collection, description="The synthetic set", exist_ok=True)
    total = per_class * len(CLASSES)
    with Progress(console=console) as progress, ThreadPoolExecutor(4) as pool:
        bar = progress.add_task("making and uploading", total=total)
        uploads = []
        for shape in synthetic_set(per_class, seed):
            uploads.append(pool.submit(client.upload, collection, shape.mesh, name=shape.name, label=shape.label))
            progress.advance(bar)
        for upload in uploads:
            upload.result()
        bar = progress.add_task("describing", total=total)
        while True:
            counts = client.collection(collection).counts
            waiting = sum(counts["states"].get(state, 0) for state in ("queued", "running"))
            progress.update(bar, completed=max(0, total - waiting))
            if not waiting:
                break
            time.sleep(0.3)
    for failed in client.shapes(collection, state="failed"):
        console.print(f"[red]failed[/] {failed.name}: {(failed.error or {}).get('detail')}")


def _draw(client: Client, collection: str, name: str, shape: str, answer: Answer, kind: str) -> bytes:
    from reebase.pictures import HitPanel, Panel, answer_picture

    def panel(title: str, identifier: str) -> Panel:
        mesh = client.mesh(collection, identifier)
        return Panel(mesh, client.skeleton(collection, identifier), title)

    hits = [
        HitPanel(
            panel(hit.shape.name, hit.shape.id),
            hit.dissimilarity,
            tuple((pair.query, pair.hit) for pair in hit.pairs),
        )
        for hit in answer.hits
    ]
    return answer_picture(panel(name, shape), hits, format=kind)
