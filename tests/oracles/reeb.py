"""The Reeb graph and its pruning in straight loops over polygons and dictionaries (METHOD §4)."""

from __future__ import annotations

import itertools
from collections import defaultdict

import numpy as np

TIE = 1e-9


def clipped(polygon, level, keep):
    """Sutherland and Hodgman: the part of a polygon of (point, value) with keep * (value - level) >= 0."""
    result = []
    for (p, s), (q, t) in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        inside, after = keep * (s - level) >= 0, keep * (t - level) >= 0
        if inside:
            result.append((p, s))
        if inside != after:
            share = (level - s) / (t - s)
            result.append((p + share * (q - p), level))
    return result


def area_and_moment(polygon):
    area, moment = 0.0, np.zeros(3)
    points = [p for p, _ in polygon]
    for q, r in itertools.pairwise(points[1:]):
        piece = 0.5 * np.linalg.norm(np.cross(q - points[0], r - points[0]))
        area += piece
        moment += piece * (points[0] + q + r) / 3
    return area, moment


def bands_of(low, high, bands):
    """Every band that [low, high] meets in more than a point; if it is a point, every band that holds it."""
    for band in range(bands):
        if min(high, band + 1) > max(low, band) or (low == high and band <= low <= band + 1):
            yield band


def reeb_graph(mesh, values, bands):
    """Nodes as (band, area, centroid, ring area of the extremal vertex), edges as pairs of node numbers."""
    u = [(v - min(values)) / (max(values) - min(values)) * bands for v in values]
    u = [round(x) if abs(x - round(x)) < TIE else x for x in u]
    faces, vertices = mesh.faces.tolist(), mesh.vertices
    pieces = {}  # (face, band) -> area, moment
    rings = defaultdict(float)
    for f, face in enumerate(faces):
        triangle = [(vertices[v], u[v]) for v in face]
        for v in face:
            rings[v] += area_and_moment(triangle)[0]
        own = list(bands_of(min(u[v] for v in face), max(u[v] for v in face), bands))
        for band in own:
            flat = len({u[v] for v in face}) == 1
            part = triangle if flat else clipped(clipped(triangle, band, 1), band + 1, -1)
            area, moment = area_and_moment(part)
            share = 1 / len(own) if flat else 1
            pieces[f, band] = (share * area, share * moment)

    at_edge = defaultdict(list)
    for f, face in enumerate(faces):
        for v, w in zip(face, face[1:] + face[:1], strict=True):
            at_edge[min(v, w), max(v, w)].append(f)
    parent = {piece: piece for piece in pieces}

    def find(x):
        while parent[x] != x:
            x = parent[x]
        return x

    touching = []
    for (v, w), around in at_edge.items():
        met = list(bands_of(min(u[v], u[w]), max(u[v], u[w]), bands))
        for band in met:
            here = [(f, band) for f in around if (f, band) in pieces]
            for x, y in itertools.pairwise(here):
                parent[find(x)] = find(y)
        if u[v] == u[w] and len(met) == 2:
            below, above = ([(f, band) for f in around if (f, band) in pieces] for band in met)
            touching += itertools.product(below, above)
    touching += [((f, b), (f, b + 1)) for f, b in pieces if (f, b + 1) in pieces]

    number, totals = {}, []
    for (f, band), (area, moment) in pieces.items():
        node = number.setdefault(find((f, band)), len(number))
        if node == len(totals):
            totals.append([band, 0.0, np.zeros(3), set()])
        totals[node][1] += area
        totals[node][2] = totals[node][2] + moment
        totals[node][3] |= {v for v in faces[f] if band <= u[v] <= band + 1}
    edges = {(number[find(x)], number[find(y)]) for x, y in touching}
    nodes = []
    for node, (band, area, moment, inside) in enumerate(totals):
        above = any(a == node for a, _ in edges)
        below = any(b == node for _, b in edges)

        def outward(v, above=above, below=below):
            if above and not below:
                return -u[v]
            return u[v] if below and not above else abs(u[v] - bands / 2)

        furthest = max((outward(v) for v in inside), default=None)
        ring = max((rings[v] for v in inside if abs(outward(v) - furthest) < TIE), default=0.0)
        nodes.append((band, area, moment / area, ring))
    return nodes, edges


def prune(areas, edges, lengths, threshold, saliency):
    """Kept nodes with their areas; every round looks at everything."""
    areas = dict(enumerate(areas))
    links = {tuple(sorted(e)): length for e, length in zip(edges, lengths, strict=True)}
    total_area, total_length = sum(areas.values()), sum(links.values())
    while True:
        around = defaultdict(dict)
        for (a, b), length in links.items():
            around[a][b] = around[b][a] = length
        ends = [node for node in areas if len(around[node]) == 1]
        if len(ends) <= 2:
            return areas
        candidates = []
        for end in ends:
            branch, node, before, length = [], end, None, 0.0
            while len(around[node]) < 3:
                branch.append(node)
                onward = next(n for n in around[node] if n != before)
                length += around[node][onward]
                before, node = node, onward
            share = length / total_length
            if saliency == "area":
                share = sum(areas[n] for n in branch) / total_area
            candidates.append((share, areas[end], end, branch, node))
        share, _, _, branch, junction = min(candidates)
        if share >= threshold:
            return areas
        areas[junction] += sum(areas.pop(n) for n in branch)
        links = {e: length for e, length in links.items() if not set(e) & set(branch)}
