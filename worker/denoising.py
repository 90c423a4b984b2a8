"""The computation of the kind ``denoise``: one mesh in, one out, and what was done to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, BinaryIO

from reebase.mesh.mesh import Mesh

__all__ = ["denoise"]


def denoise(
    arguments: dict[str, Any], source: BinaryIO, outputs: Mapping[str, BinaryIO],
    progress: Callable[[str, float], None],
) -> dict[str, Any]:  # fmt: skip
    """Read a mesh, and its truth where one is beside it, and run a filter.

    arguments: ``parts`` (of the source, by name: ``start``, ``size``, ``format``; ``file`` and perhaps ``truth``),
    ``method``, ``iterations``, ``boundary``, ``parameters``, ``limits``. outputs: ``mesh``, PLY with the length of
    each vertex's way as ``displacement``. Raises what reading and denoising raise, ParameterError when the truth has
    other faces.
    """
    import numpy as np

    from reebase.denoise import apply_choice, choose, joined_soup, measure_errors
    from reebase.denoise import denoise as filtered
    from reebase.mesh.geometry import lengths, mean_edge_length
    from reebase.mesh.read import Limits, read
    from reebase.mesh.write import to_bytes

    limits = Limits(**arguments["limits"])

    def part(name: str) -> Mesh:
        place = arguments["parts"][name]
        source.seek(place["start"])
        return joined_soup(read(source.read(place["size"]), place["format"], limits=limits))

    progress("read", 0.0)
    before = part("file")
    truth = part("truth") if "truth" in arguments["parts"] else None
    errors = {} if truth is None else {"before": asdict(measure_errors(truth, before))}
    method, parameters = arguments["method"], arguments["parameters"]
    progress("denoise", 0.1)
    choice = None
    if method == "auto":
        choice = choose(before, progress=lambda share: progress("denoise", 0.1 + 0.3 * share))
    if choice is not None and arguments["iterations"] == 1:
        after = apply_choice(
            before, choice, arguments["boundary"], progress=lambda share: progress("denoise", 0.4 + 0.4 * share)
        )
    else:
        after = filtered(
            before, method, arguments["iterations"], boundary=arguments["boundary"],
            progress=lambda share: progress("denoise", 0.1 + 0.7 * share), **parameters,
        )  # fmt: skip
    if truth is not None:
        progress("measure", 0.8)
        errors["after"] = asdict(measure_errors(truth, after))
    progress("write", 0.95)
    left = choice is not None and not choice.parts
    used = np.unique(before.faces)
    ways = np.zeros(len(before.vertices))
    ways[used] = lengths(after.vertices[used] - before.vertices[used])
    outputs["mesh"].write(to_bytes(after, "ply", scalars={"displacement": ways}))
    return {
        "method": method, "iterations": 0 if left else arguments["iterations"], "boundary": arguments["boundary"],
        "parameters": parameters, "choice": None if choice is None else asdict(choice),
        "vertices": len(after.vertices), "faces": len(after.faces), "mean_edge_length": mean_edge_length(before),
        "displacement": {
            "mean": float(ways[used].mean()) if len(used) else 0.0, "largest": float(ways.max(initial=0.0)),
        },
        "errors": errors or None,
    }  # fmt: skip
