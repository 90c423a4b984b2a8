"""The command line: what `reebase` does without the application (ingest, evaluate, query, duplicates, ...)."""

from __future__ import annotations

import sys

from reebase.errors import MissingPackage, ReebaseError

try:
    import typer
except ImportError as missing:  # pragma: no cover - depends on what is installed
    raise MissingPackage("The command line needs typer: pip install 'reebase[client]'.") from missing

from reebase.cli.denoise import EPILOG, denoise
from reebase.cli.duplicates import duplicates
from reebase.cli.evaluate import evaluate
from reebase.cli.ingest import ingest
from reebase.cli.query import query
from reebase.cli.skeleton import skeleton
from reebase.words import program

__all__ = ["app", "main"]

app = typer.Typer(
    name="reebase",
    help="Which shapes are like this one? Retrieval of deformable 3D shapes, with reasons.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
for command in (skeleton, evaluate, duplicates, ingest, query):
    app.command()(command)
app.command(epilog=EPILOG)(denoise)


def main() -> None:
    """Run the command line; a refusal is one line on standard error and exit code 2, never a traceback."""
    try:
        app(prog_name=program())
    except ReebaseError as refusal:
        _refuse(f"{refusal.message} [{refusal.code}]", *_values(refusal))
    except OSError as failure:
        where = f": {failure.filename}" if failure.filename is not None else ""
        _refuse(f"{failure.strerror or failure}{where}")


def _values(refusal: ReebaseError) -> list[str]:
    """The values of a request that a service refused, where its words do not name them already."""
    found = [str(one.get("detail", "")) for one in getattr(refusal, "errors", ())]
    return [f"  {detail}" for detail in found if detail and detail not in refusal.message]


def _refuse(*lines: str) -> None:
    lines = (f"reebase: {lines[0]}", *lines[1:])
    print(*lines, sep="\n", file=sys.stderr)  # noqa: T201 - a refusal is for people
    sys.exit(2)
