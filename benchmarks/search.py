"""One query against many shapes: the index beside a loop over scipy's linear_sum_assignment.

    ./run python benchmarks/search.py [--shapes 100000] [--prototypes 200] [--queries 50] [--k 10]

Each shape is one of the prototypes, of 2 to 16 endpoints (8 on average), with 5 % noise, so that a query has
near ones as it would among real shapes; with as many prototypes as shapes, all are strangers. Times are the
median over the queries, on one core, once the kernels are loaded. The loop pads the smaller set with zero vectors
and is run over the candidates of three queries. Exits 1 when its answers are others.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable

import numba
import numpy as np
import numpy.typing as npt
import scipy
from scipy.optimize import linear_sum_assignment

from reebase.matching import MEASURES, dissimilarity
from reebase.search import Index

Features = npt.NDArray[np.float64]


def drawn(generator: np.random.Generator, count: int, kinds: int) -> list[Features]:
    """Endpoint features like those of articulated shapes: a small share of area, dc that sum to 1."""
    prototypes = []
    for size in 2 + generator.binomial(14, 6 / 14, size=kinds):
        lengths = generator.gamma(4.0, size=size)
        areas = generator.gamma(2.0, 0.01, size=size)
        prototypes.append(np.column_stack([areas, 1 + generator.random(size), lengths / lengths.sum()]))
    chosen = generator.integers(0, len(prototypes), size=count)
    return [prototypes[c] * np.exp(0.05 * generator.normal(size=prototypes[c].shape)) for c in chosen]


def by_scipy(query: Features, shapes: list[Features], tolerance: int, k: int) -> list[tuple[float, int]]:
    """The k nearest by ``matching``, each shape compared by one call of scipy's solver."""
    found = []
    for number, shape in enumerate(shapes):
        if abs(len(shape) - len(query)) > tolerance:
            continue
        size = max(len(shape), len(query))
        a, b = np.zeros((2, size, 3))
        a[: len(query)], b[: len(shape)] = query, shape
        cost = np.sqrt(((a[:, None] - b[None]) ** 2).sum(axis=2))
        rows, columns = linear_sum_assignment(cost)
        found.append((float(cost[rows, columns].sum()), number))
    return sorted(found)[:k]


def seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--shapes", type=int, default=100_000)
    parser.add_argument("--prototypes", type=int, default=200)
    parser.add_argument("--queries", type=int, default=50)
    parser.add_argument("--k", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    shapes = drawn(np.random.default_rng(asked.seed), asked.shapes + asked.queries, asked.prototypes)
    shapes, queries = shapes[: asked.shapes], shapes[asked.shapes :]
    index = Index()
    filling = seconds(lambda: [index.add(f"{number:09}", shape) for number, shape in enumerate(shapes)])
    print(f"numba {numba.__version__}, scipy {scipy.__version__}, numpy {np.__version__}")
    print(f"{len(index)} shapes, {np.mean([*map(len, shapes)]):.1f} endpoints on average, "
          f"indexed in {filling:.2f} s")  # fmt: skip

    index.query(queries[0], k=1)
    for tolerance in (2, None):
        considered = [sum(index.considered(len(q), tolerance=tolerance).values()) for q in queries]
        print(f"\ntolerance {tolerance}: {statistics.median(considered):.0f} candidates (median)")
        for measure in MEASURES:
            options = {"k": asked.k, "tolerance": tolerance, "measure": measure}
            times = [seconds(lambda q=q, o=options: index.query(q, **o)) for q in queries]
            everything = [
                seconds(lambda q=q, o=options: index.query(q, **{**o, "k": asked.shapes}))
                for q in queries[:5]
            ]
            usual, worst, full = statistics.median(times), max(times), statistics.median(everything)
            print(f"  {measure:<14} {1e3 * usual:8.2f} ms, at most {1e3 * worst:8.2f} ms; "
                  f"all candidates ranked {1e3 * full:8.2f} ms")  # fmt: skip

    print("\nbeside the loop over scipy, tolerance 2, matching:")
    for query in queries[:3]:
        expected: list[tuple[float, int]] = []
        slow = seconds(lambda q=query, e=expected: e.extend(by_scipy(q, shapes, 2, asked.k)))
        fast = seconds(lambda q=query: index.query(q, k=asked.k))
        hits = index.query(query, k=asked.k)
        print(f"  {len(query):2} endpoints: {slow:7.3f} s and {1e3 * fast:7.2f} ms, {slow / fast:6.0f} times")
        if [int(hit.id) for hit in hits] != [number for _, number in expected]:
            print("  the answers differ", file=sys.stderr)
            return 1

    generator = np.random.default_rng(asked.seed)
    print("\none pair with many endpoints (ours, with the checks, and scipy's with the cost matrix):")
    for size in (10, 30, 100, 300):
        a, b = generator.random((2, size, 3))
        ours = statistics.median(seconds(lambda a=a, b=b: dissimilarity(a, b)) for _ in range(9))
        theirs = statistics.median(seconds(lambda a=a, b=b: by_scipy(a, [b], 0, 1)) for _ in range(9))
        print(f"  {size:4} endpoints: {1e3 * ours:8.3f} ms, scipy {1e3 * theirs:8.3f} ms, "
              f"{theirs / ours:5.1f} times")  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
