"""Pruning: terminal branches that are not salient are removed, the least salient first (METHOD §4)."""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError, unknown_name
from reebase.skeleton.graph import Skeleton

__all__ = ["SALIENCIES", "prune", "prune_to"]

SALIENCIES = ("area", "length")


def prune(skeleton: Skeleton, threshold: float = 0.01, saliency: str = "area") -> Skeleton:
    """The skeleton without its terminal branches of less than ``threshold`` saliency.

    A terminal branch runs from an endpoint up to, not including, the first node of degree 3 or more, its
    junction.
    saliency: "area", the share of the branch in the area of the surface; or "length", the share of the
    branch's edges, the one to the junction included, in the length of all edges. threshold: in [0, 1).

    The least salient branch goes first; its area goes to the junction, and a junction that is left with two
    edges is one no longer, so that the branch that ended there grows. The last two endpoints always stay, and
    so does every cycle. Nodes keep their order; the root is kept, or moves to the node that is now nearest to
    the area centroid of the surface. Raises ParameterError, UnknownName.
    """
    if saliency not in SALIENCIES:
        raise unknown_name("saliency", saliency, SALIENCIES)
    if not 0.0 <= threshold < 1.0:
        raise ParameterError(
            f"The pruning threshold is a share, at least 0 and below 1; found {threshold!r}.",
            parameter="threshold", minimum=0, maximum=1,
        )  # fmt: skip
    areas: list[float] = skeleton.areas.tolist()
    neighbours: list[dict[int, float]] = [{} for _ in areas]  # node -> length of the edge to it
    for (a, b), length in zip(skeleton.edges.tolist(), skeleton.lengths.tolist(), strict=True):
        neighbours[a][b] = neighbours[b][a] = length
    total = float(skeleton.areas.sum() if saliency == "area" else skeleton.lengths.sum()) or 1.0
    branches = {end: _Branch(head=end) for end in skeleton.endpoints.tolist()}
    ending_at: dict[int, set[int]] = {}  # junction -> endpoints of the branches that end there
    queue: list[tuple[float, float, int]] = []  # saliency, area of the endpoint's node, endpoint
    removed = np.zeros(len(areas), dtype=bool)

    def grow(end: int) -> None:
        """Take nodes into the branch of ``end`` up to its junction, and queue it."""
        branch = branches[end]
        while len(neighbours[branch.head]) < 3:
            node, before = branch.head, branch.nodes[-1] if branch.nodes else -1
            branch.nodes.append(node)
            branch.area += areas[node]
            onward = [n for n in neighbours[node] if n != before]
            if not onward:
                return  # the whole graph is one path: nothing to cut
            branch.head = onward[0]
            branch.length += neighbours[node][branch.head]
        branch.saliency = (branch.area if saliency == "area" else branch.length) / total
        ending_at.setdefault(branch.head, set()).add(end)
        heapq.heappush(queue, (branch.saliency, areas[end], end))

    for end in branches:
        grow(end)
    while len(branches) > 2 and queue and queue[0][0] < threshold:
        found, _, end = heapq.heappop(queue)
        if end not in branches or found != branches[end].saliency:
            continue  # the branch has grown since
        branch = branches.pop(end)
        junction = branch.head
        removed[branch.nodes] = True
        del neighbours[junction][branch.nodes[-1]]
        areas[junction] += branch.area
        ending_at[junction].remove(end)
        if len(neighbours[junction]) == 2:
            for other in ending_at.pop(junction):
                grow(other)
    return _without(skeleton, removed, np.array(areas))


def prune_to(skeleton: Skeleton, ends: npt.ArrayLike) -> Skeleton:
    """The skeleton without the branches that end elsewhere than in ``ends``, nodes, whose order its endpoints take.

    What is removed gives its area to the node where it began; every cycle stays. A single end keeps the path to the
    node of the lowest band, the largest of them. Raises ParameterError for what is no node, or given twice.
    """
    chosen = np.asarray(ends, dtype=np.int64).reshape(-1)
    count = len(skeleton.positions)
    if len(np.unique(chosen)) < len(chosen) or not ((chosen >= 0) & (chosen < count)).all() or not len(chosen):
        raise ParameterError(f"Ends are different nodes, 0 to {count - 1}; found {chosen.tolist()}.", parameter="ends")
    kept = np.isin(np.arange(count), chosen)
    if len(chosen) == 1:
        kept[np.lexsort((-skeleton.areas, skeleton.bands))[0]] = True
    neighbours: list[set[int]] = [set() for _ in range(count)]
    for a, b in skeleton.edges.tolist():
        neighbours[a].add(b)
        neighbours[b].add(a)
    areas = skeleton.areas.copy()
    removed = np.zeros(count, dtype=bool)
    ready = [node for node in range(count) if len(neighbours[node]) == 1 and not kept[node]]
    for node in ready:  # grows while it is walked
        before = neighbours[node].pop()
        removed[node] = True
        areas[before] += areas[node]
        neighbours[before].remove(node)
        if len(neighbours[before]) == 1 and not kept[before]:
            ready.append(before)
    rank = np.cumsum(~removed, dtype=np.int32) - 1
    return replace(_without(skeleton, removed, areas), endpoints=rank[chosen].astype(np.int32))


@dataclass(eq=False)
class _Branch:
    """A terminal branch: the node that it has reached but not taken, and its nodes from the endpoint on."""

    head: int
    nodes: list[int] = field(default_factory=list)
    area: float = 0.0
    length: float = 0.0
    saliency: float = np.inf


def _without(
    skeleton: Skeleton, removed: npt.NDArray[np.bool_], areas: npt.NDArray[np.float64]
) -> Skeleton:
    """The skeleton without the removed nodes and their edges, with new areas of what is kept."""
    if not removed.any():
        return skeleton
    kept = np.flatnonzero(~removed)
    rank = np.cumsum(~removed, dtype=np.int32) - 1
    stay = ~removed[skeleton.edges].any(axis=1)
    root = skeleton.root
    if removed[root]:
        distance = np.linalg.norm(skeleton.positions[kept] - skeleton.centroid, axis=1)
        root = int(kept[np.argmin(distance)])
    return Skeleton.assembled(
        skeleton.positions[kept], areas[kept], skeleton.ring_areas[kept], skeleton.bands[kept],
        rank[skeleton.edges[stay]].astype(np.int32), int(rank[root]), skeleton.joins[stay],
    )  # fmt: skip
