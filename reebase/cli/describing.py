"""Many meshes through the pipeline in several processes, one of which may die without harm to the others."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import numpy.typing as npt

from reebase.descriptors import descriptor_named, surface_of
from reebase.errors import ReebaseError
from reebase.pipeline import Profile, describe

__all__ = ["Kept", "Outcome", "Refusal", "descriptions"]


@dataclass(frozen=True, eq=False)
class Kept:
    """What is kept of a mesh by each descriptor, and the seconds that each took.

    seconds: ``pipeline``, ``eigenpairs`` where more than the skeleton's endpoints are kept, and each descriptor beyond
    these.
    """

    arrays: dict[str, npt.NDArray[np.float64]]
    seconds: dict[str, float]


@dataclass(frozen=True)
class Refusal:
    """Why there is no description of a mesh."""

    code: str
    detail: str


Outcome = Kept | Refusal
"""What is kept of a mesh, or why there is nothing."""

_DIED = Refusal("worker_died", "The process that described this mesh died, most likely for want of memory.")


def descriptions(
    files: Sequence[Path], profile: Profile, descriptors: Sequence[str], jobs: int
) -> Iterator[tuple[Path, Outcome]]:
    """Each file with its description or its refusal, as they are done; the numbers do not depend on ``jobs``.

    jobs: processes, 0 for one a core. A process that dies takes its pool with it. What was being described at that
    moment is then tried file by file, so that only the mesh that kills its process is refused.
    """
    workers = max(1, min(jobs or os.cpu_count() or 1, len(files)))
    if workers == 1:
        yield from ((path, _described(path, profile, descriptors)) for path in files)
        return
    left = deque(files)
    while left:
        running: dict[Future[Outcome], Path] = {}
        lost: list[Path] = []
        with _pool(workers) as pool:
            while (left or running) and not lost:
                # No more than there are processes: what is lost with the pool is what they were at.
                while left and len(running) < workers:
                    path = left.popleft()
                    try:
                        running[pool.submit(_described, path, profile, descriptors)] = path
                    except BrokenProcessPool:
                        lost.append(path)
                        break
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    path = running.pop(future)
                    outcome = _outcome(future)
                    if outcome is None:
                        lost.append(path)
                    else:
                        yield path, outcome
            # Of a broken pool all of them end at once.
            for future, path in running.items():
                outcome = _outcome(future)
                if outcome is None:
                    lost.append(path)
                else:
                    yield path, outcome
        for path in lost:
            yield path, _alone(path, profile, descriptors)


def _pool(workers: int) -> ProcessPoolExecutor:
    # Each process has a core to itself: threads of the linear algebra would only wait for those of the others. It
    # reads this when it is loaded, so the children must find it in their environment.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    return ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_prepare)


def _prepare() -> None:
    """In the child: Ctrl-C ends it without a traceback, and it does not outlive its parent."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    threading.Thread(target=_die_with_parent, daemon=True).start()


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _outcome(future: Future[Outcome]) -> Outcome | None:
    """None when the pool broke before this one was done."""
    try:
        return future.result()
    except BrokenProcessPool:
        return None


def _alone(path: Path, profile: Profile, descriptors: Sequence[str]) -> Outcome:
    with _pool(1) as pool:
        found = _outcome(pool.submit(_described, path, profile, descriptors))
    return _DIED if found is None else found


def _described(path: Path, profile: Profile, descriptors: Sequence[str]) -> Outcome:
    try:
        return _kept(path, profile, descriptors)
    except ReebaseError as refusal:
        return Refusal(refusal.code, refusal.message)
    except OSError as failure:
        return Refusal("unreadable", f"The file cannot be read: {failure.strerror or failure}.")
    except MemoryError:
        return Refusal("out_of_memory", "There was not enough memory for this mesh.")


def _kept(path: Path, profile: Profile, descriptors: Sequence[str]) -> Kept:
    begun = time.perf_counter()
    surface = surface_of(describe(path, profile))
    seconds = {"pipeline": time.perf_counter() - begun}
    if any(name != "srg" for name in descriptors):
        begun = time.perf_counter()
        surface.spectrum()
        seconds["eigenpairs"] = time.perf_counter() - begun
    arrays = {}
    for name in descriptors:
        begun = time.perf_counter()
        arrays[name] = descriptor_named(name).describe(surface)
        seconds[name] = time.perf_counter() - begun
    return Kept(arrays, seconds)
