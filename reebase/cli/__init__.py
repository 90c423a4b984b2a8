"""The command line: what `reebase` does without the application (ingest, evaluate, query, skeleton)."""

from __future__ import annotations

import sys

from reebase.errors import MissingPackage, ReebaseError

try:
    import typer
except ImportError as missing:  # pragma: no cover - depends on what is installed
    raise MissingPackage("The command line needs typer: pip install 'reebase[client]'.") from missing

from reebase.cli.evaluate import evaluate
from reebase.cli.ingest import ingest
from reebase.cli.query import query
from reebase.cli.skeleton import skeleton

__all__ = ["app", "main"]

app = typer.Typer(
    name="reebase",
    help="Which shapes are like this one? Retrieval of deformable 3D shapes, with reasons.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
for command in (skeleton, evaluate, ingest, query):
    app.command()(command)


def main() -> None:
    """Run the command line; a refusal is one line on standard error and exit code 2, never a traceback."""
    try:
        app()
    except ReebaseError as refusal:
        print(f"reebase: {refusal.message} [{refusal.code}]", file=sys.stderr)  # noqa: T201 - a refusal is for people
        sys.exit(2)
    except OSError as failure:
        print(f"reebase: {failure.strerror or failure}: {failure.filename or ''}", file=sys.stderr)  # noqa: T201
        sys.exit(2)
