"""`reebase demo`: a collection of synthetic shapes, and a query with its reasons as a table and a picture."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import ValidationError

from reebase.cli import options
from reebase.cli.output import Steps, check_picture, notices, progress, results, write_bytes
from reebase.cli.query import print_answer
from reebase.client import Answer, Client, Shape
from reebase.errors import ComputationError, ParameterError
from reebase.words import program
from store.settings import Settings

START_SECONDS = 90.0
STOP_SECONDS = 30.0
HITS = 9
SENDERS = 4
_CHECKOUT = Path(__file__).resolve().parent.parent


def demo(
    url: Annotated[
        str | None, typer.Option(help="A running service; by default one is started for the time of the demo.")
    ] = None,
    collection: Annotated[str, typer.Option(help="The collection to fill.")] = "demo",
    per_class: Annotated[int, typer.Option(help="Shapes of each of the ten classes.", min=1, max=200)] = 25,
    seed: Annotated[int, typer.Option(help="The same seed gives the same shapes.", min=0)] = 0,
    query: Annotated[str, typer.Option(help="Name of the shape to query with.")] = "humans-00",
    picture: Annotated[
        Path | None, typer.Option(help="Where to write the picture, .png or .svg.", show_default="demo.png in the home")
    ] = None,
    api_key: options.Key = None,
) -> None:
    """Fill a collection with the synthetic set, query it, and show the answer with its reasons.

    Run it again to go on where it stopped. Exit code 0: shown. 2: it could not run. 130: Ctrl-C.
    """
    _check_query(query, per_class)
    home = _home()
    target = picture or home / "demo.png"
    target.parent.mkdir(parents=True, exist_ok=True)
    kind = check_picture(target)
    try:
        with _service(url, home) as address, Client(address, api_key=api_key, patience=30.0) as client:
            shapes = _filled(client, collection, per_class, seed)
            if query not in shapes:
                raise ParameterError(f"The collection {collection!r} has no indexed shape named {query}.")
            answer = client.query(collection, shape=shapes[query].id, k=HITS)
            out = results()
            out.print(f"\nWhich shapes of {collection} are like {query}?")
            print_answer(answer, out)
            write_bytes(target, _draw(client, collection, shapes[query], answer, kind), tell=False)
    except (KeyboardInterrupt, SystemExit):
        notices().print(f"Stopped; the shapes in the collection {collection!r} are kept. Run it again to go on.")
        raise
    out.print(f"The query and its hits, with their skeletons: {target}")
    if url is None:
        out.print(f"The collection {collection!r} is kept: see it with {program()} serve.")


def _check_query(query: str, per_class: int) -> None:
    from reebase.evaluation.synthetic import CLASSES

    label, _, number = query.rpartition("-")
    if label not in CLASSES or not number.isdecimal() or int(number) >= per_class:
        raise ParameterError(
            f"The set has no shape named {query!r}; it has {CLASSES[0]}-00 to {CLASSES[0]}-{per_class - 1:02d}, "
            f"and as many of {', '.join(CLASSES[1:])}."
        )


def _home() -> Path:
    try:
        return Settings().home
    except ValidationError as wrong:
        one = wrong.errors()[0]
        raise ParameterError(f"REEBASE_{'_'.join(str(p) for p in one['loc']).upper()}: {one['msg']}") from wrong


@contextmanager
def _service(url: str | None, home: Path) -> Iterator[str]:
    """The service at ``url``, or one of our own on a free port, stopped afterwards whatever happens."""
    if url is not None:
        yield url
        return
    log = home / "demo.log"
    command = [sys.executable, "-m", "service", "serve", "--host", "127.0.0.1", "--port", "0"]
    command += ["--workers", str(os.cpu_count() or 1)]
    # SIGTERM and a closed terminal must stop the service too, so they end us as Ctrl-C does.
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, _interrupt)
    with log.open("wb") as output:
        # A session of its own: Ctrl-C in the terminal must reach us alone, who still need the service to stop in order.
        server = subprocess.Popen(  # noqa: S603 - our own module
            command, cwd=_CHECKOUT, stdin=subprocess.DEVNULL, stdout=output, stderr=output, start_new_session=True
        )
        try:
            notices().print("Starting the service ...")
            yield _address(server, log)
        finally:
            _stop(server)


def _interrupt(number: int, _: Any) -> None:
    raise SystemExit(128 + number)


def _stop(server: subprocess.Popen[bytes]) -> None:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # a second Ctrl-C would leave it running
    server.terminate()
    try:
        server.wait(STOP_SECONDS)
    except subprocess.TimeoutExpired:
        server.kill()
        server.wait()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def _address(server: subprocess.Popen[bytes], log: Path) -> str:
    """Where it answers, once it does. Raises ComputationError."""
    end = time.monotonic() + START_SECONDS
    while server.poll() is None and time.monotonic() < end:
        said = re.search(r"address +(http://\S+)", log.read_text(errors="replace"))
        if said:
            with Client(said[1]) as client:
                if client.ready():
                    return said[1]
        time.sleep(0.1)
    raise ComputationError(f"The service did not start; {log} says why.")


def _filled(client: Client, collection: str, per_class: int, seed: int) -> dict[str, Shape]:
    """The indexed shapes of the set by name, once what was not there is uploaded and described."""
    client.create_collection(collection, description="The synthetic set", exist_ok=True)
    with progress() as begin:
        _upload(client, collection, per_class, seed, begin)
        step = begin("describing", per_class * 10)
        while True:
            counts = client.collection(collection).counts
            waiting = counts.states.get("queued", 0) + counts.states.get("running", 0)
            step.update(max(0, per_class * 10 - waiting))
            if not waiting:
                break
            time.sleep(0.3)
    shapes = [shape for shape in client.shapes(collection) if shape.metadata.get("seed") == seed]
    for shape in shapes:
        if shape.state != "indexed":
            why = f"{shape.error.detail} [{shape.error.code}]" if shape.error else ""
            notices().print(f"{shape.state}: {shape.name} {why}")
    return {shape.name: shape for shape in shapes if shape.state == "indexed"}


def _upload(client: Client, collection: str, per_class: int, seed: int, begin: Steps) -> None:
    """Make and upload what is not there yet; a shape is known by its name and the seed."""
    from reebase.evaluation.synthetic import CLASSES, synthetic_shape

    there = {shape.name for shape in client.shapes(collection) if shape.metadata.get("seed") == seed}
    wanted = [(label, index) for label in CLASSES for index in range(per_class)]
    missing = [(label, index) for label, index in wanted if f"{label}-{index:02d}" not in there]
    step = begin("making and uploading", len(wanted))
    step.update(len(wanted) - len(missing))

    def send(label: str, index: int) -> None:
        made = synthetic_shape(label, index, seed)
        about: dict[str, Any] = {"name": made.name, "label": made.label, "metadata": {"seed": seed}}
        upload = client.upload(collection, made.mesh, **about)
        if not upload.created:
            client.update_shape(collection, upload.shape.id, **about)  # somebody else uploaded these bytes

    with ThreadPoolExecutor(SENDERS) as pool:
        try:
            uploads: list[Future[None]] = [pool.submit(send, label, index) for label, index in missing]
            for done, upload in enumerate(as_completed(uploads), start=1):
                upload.result()
                step.update(len(wanted) - len(missing) + done)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _draw(client: Client, collection: str, query: Shape, answer: Answer, kind: str) -> bytes:
    from reebase.pictures import HitPanel, Panel, answer_picture

    def panel(title: str, identifier: str) -> Panel:
        mesh = client.mesh(collection, identifier)
        return Panel(mesh, client.skeleton(collection, identifier), title)

    hits = [
        HitPanel(
            panel(hit.shape.name, hit.shape.id),
            hit.graph_dissimilarity,
            tuple((pair.query, pair.hit) for pair in hit.pairs),
        )
        for hit in answer.hits
    ]
    return answer_picture(panel(query.name, query.id), hits, format=kind)
