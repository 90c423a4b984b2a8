"""`reebase duplicates`: which meshes of a folder are one shape, and what was done to it; nothing is deleted."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from reebase.cli import options
from reebase.cli.describing import Refusal
from reebase.cli.folders import mesh_files
from reebase.cli.output import STDOUT, Steps, check_target, print_table, progress, results, shown, write_json
from reebase.duplicates import Finding, Shape, find_duplicates
from reebase.errors import ParameterError, ReebaseError
from reebase.mesh import Mesh, clean, read
from reebase.words import counted


def duplicates(
    folder: Annotated[Path, typer.Argument(help="A folder of mesh files; hidden ones are passed over.", metavar="DIR")],
    json_out: options.JsonOut = None,
) -> None:
    """Find meshes that are one shape: exported again, moved, rescaled, mirrored, remeshed, decimated, or copied.

    Each finding has its numbers. Nothing is changed. Exit code 0: all meshes were compared. 1: some could not be read,
    and a table says why. 2: it could not run.
    """
    check_target(json_out)
    files = mesh_files(folder)
    with progress() as begin:
        shapes, failed = _shapes(folder, files, begin)
        if not shapes:
            name, first = next(iter(failed.items()))
            raise ParameterError(f"No mesh could be read; {name}: {first.detail} [{first.code}]")
        step = begin("comparing", 100)
        found = find_duplicates(shapes, progress=lambda fraction: step.update(int(100 * fraction)))
    if json_out is not None:
        record = {
            "shapes": len(shapes), "findings": [one.to_json() for one in found],
            "failed": {name: {"code": one.code, "detail": one.detail} for name, one in sorted(failed.items())},
        }  # fmt: skip
        write_json(json_out, record)
    if json_out != STDOUT:
        _print(found, len(shapes), failed)
    raise typer.Exit(1 if failed else 0)


def _shapes(folder: Path, files: list[Path], begin: Steps) -> tuple[list[Shape], dict[str, Refusal]]:
    """The shapes, whose meshes are read again when they are needed, and why others are left out."""
    shapes, failed = [], {}
    step = begin("reading", len(files))
    for number, path in enumerate(files, start=1):
        name = shown(path.relative_to(folder).as_posix())
        try:
            data = path.read_bytes()
            one = Shape.of(name, _cleaned(path), data)
            shapes.append(Shape(name, partial(_cleaned, path), one.signature, one.sha256))
        except ReebaseError as refusal:
            failed[name] = Refusal(refusal.code, refusal.message)
        except OSError as failure:
            failed[name] = Refusal("unreadable", f"The file cannot be read: {failure.strerror or failure}.")
        step.update(number)
    return shapes, failed


def _cleaned(path: Path) -> Mesh:
    return clean(read(path))[0]


def _print(found: list[Finding], shapes: int, failed: dict[str, Refusal]) -> None:
    out = results()
    if found:
        rows = [(one.first, one.second, " ".join(one.classes), one.confidence, shown(one.words)) for one in found]
        print_table(out, ("first", "second", "classes", "confidence", "in words"), rows, widest=4)
    else:
        out.print(f"No duplicates among {counted(shapes, 'shape')}.")
    if failed:
        print_table(out, ("left out", "code", "why"),
                    [(name, one.code, shown(one.detail)) for name, one in sorted(failed.items())])  # fmt: skip
