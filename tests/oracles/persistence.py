"""Persistent maxima by flooding: the definition, one level after the other."""

from __future__ import annotations


def maxima_by_flooding(mesh, values):
    """vertex -> persistence. The components of {v at least as high as w} for each w, searched afresh each time.

    Of equal values the smaller index is the higher.
    """
    neighbours = {v: set() for v in range(len(mesh.vertices))}
    for face in mesh.faces.tolist():
        for a in face:
            neighbours[a].update(b for b in face if b != a)

    def height(v):
        return (values[v], -v)

    order = sorted(neighbours, key=height, reverse=True)
    out = {}
    for v, ring in neighbours.items():
        if any(height(w) > height(v) for w in ring):
            continue
        out[v] = values[order[0]] - values[order[-1]]
        for level in order:  # the first level at which v's component holds something higher
            seen, stack = {v}, [v]
            while stack:
                for w in neighbours[stack.pop()]:
                    if w not in seen and height(w) >= height(level):
                        seen.add(w)
                        stack.append(w)
            if height(level) <= height(v) and any(height(w) > height(v) for w in seen):
                out[v] = values[v] - values[level]
                break
    return out
