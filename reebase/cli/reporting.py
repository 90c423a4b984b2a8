"""The report of an evaluated folder: costs, thumbnails and files."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from reebase.cli.describing import Kept, Refusal
from reebase.cli.output import Steps, check_picture, notices, shown, write_bytes
from reebase.errors import ParameterError
from reebase.report.record import Cost, Entry, Report

__all__ = ["check_report", "cost_of", "report_of", "write_report"]

_THUMBNAIL = 128
_SHARED = ("pipeline", "eigenpairs")


def check_report(folder: Path | None) -> None:
    """Make the folder, and make sure that a report can be drawn and written. Raises ParameterError, MissingPackage."""
    if folder is None:
        return
    if folder.exists() and not folder.is_dir():
        raise ParameterError(f"{folder} is a file; name a folder for the report.")
    if not folder.parent.is_dir():
        raise ParameterError(f"{folder} cannot be made: there is no folder {folder.parent}.")
    folder.mkdir(exist_ok=True)
    check_picture(folder / "precision_recall.svg")


def cost_of(parts: Iterable[str], kept: Collection[Kept]) -> Cost:
    """Of descriptors together. Medians over the shapes: the first meshes of each process wait for compiling."""
    names = list(parts)
    seconds = [sum(shape.seconds[name] for name in names) for shape in kept]
    numbers = [sum(shape.arrays[name].size for name in names) for shape in kept]
    return Cost(1000 * float(np.median(seconds)), 4 * float(np.median(numbers)))


def report_of(
    folder: Path, entries: Sequence[Entry], kept: Mapping[Path, Kept], files: Mapping[str, Path],
    facts: Mapping[str, str], failed: Mapping[str, Refusal], begin: Steps,
) -> Report:  # fmt: skip
    """The report with its thumbnails. files: the file of each shape, by the name that the entries have for it."""
    from reebase.mesh import clean, read
    from reebase.pictures.thumbnail import thumbnail
    from reebase.report.lists import shown_in

    wanted = shown_in(entries)
    step = begin("drawing", len(wanted))
    thumbnails = {}
    for number, name in enumerate(wanted, start=1):
        thumbnails[name] = thumbnail(clean(read(files[name]))[0], _THUMBNAIL)
        step.update(number)
    shared = {
        name: 1000 * float(np.median([shape.seconds[name] for shape in kept.values()]))
        for name in _SHARED
        if all(name in shape.seconds for shape in kept.values())
    }
    return Report(
        shown(folder.resolve().name), entries, facts, shared,
        {name: (one.code, one.detail) for name, one in failed.items()}, thumbnails=thumbnails,
    )  # fmt: skip


def write_report(report: Report, folder: Path, begin: Steps) -> None:
    """Write every file of the report, each whole or not at all. Raises OSError."""
    from reebase.report.files import files

    step = begin("writing the report", 100)
    written = files(report, progress=lambda fraction: step.update(int(100 * fraction)))
    for name, data in written.items():
        write_bytes(folder / name, data, tell=False)
    notices().print(f"Written: {shown(str(folder / 'index.html'))}", soft_wrap=True)
