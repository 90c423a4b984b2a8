"""Does one finite-volume iteration suffice, and does it beat the others? Each reading of sigma, FA and the normal.

    ./run python benchmarks/one_iteration.py

The same pairs as ``denoising.py``. Prints for each reading, after 1, 2, 3, 5 and 10 iterations, the mean angle in
degrees, and below the same for half steps of a uniform Laplacian; last, the mean displacement of the best.
"""

from __future__ import annotations

import itertools

import numpy as np
from denoising import DATA, pairs_in
from noisy_shapes import noisy_pairs

from reebase.denoise import denoise, displacement, mean_angle

COUNTS = (1, 2, 3, 5, 10)


def main() -> None:
    folder = DATA / "denoise-a"
    if (folder / "pairs.csv").is_file():
        pairs = pairs_in(folder)
    else:
        pairs = [(pair.name, pair.noisy, pair.truth) for pair in noisy_pairs()]
    readings = [
        ("finite_volume", {"normal": normal, "scale": scale, "anisotropy": anisotropy})
        for normal, scale, anisotropy in itertools.product(
            ("minor_eigenvector", "area_weighted"), ("median", "root_mean_square"), (True, False)
        )
    ]
    readings.append(("laplacian", {"step": 0.5}))
    print("reading".ljust(84), *(f"x{count}".rjust(6) for count in COUNTS), "  disp")
    for method, parameters in readings:
        angles, ways = [], []
        for count in COUNTS:
            results = [denoise(noisy, method, count, **parameters) for _, noisy, _ in pairs]
            both = [(truth, result) for (_, _, truth), result in zip(pairs, results, strict=True)]
            angles.append(np.mean([mean_angle(*pair) for pair in both]))
            ways.append(np.mean([displacement(*pair) for pair in both]))
        said = " ".join([method, *(f"{name}={value}" for name, value in parameters.items())])
        best = ways[int(np.argmin(angles))]
        print(said.ljust(84), *(f"{angle:6.2f}" for angle in angles), f"{best:6.3f}", flush=True)


if __name__ == "__main__":
    main()
