"""Slow twins of the denoising filters: straight loops from METHOD.md's equations, one vertex at a time."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from reebase.mesh.mesh import Mesh

FloatArray = npt.NDArray[np.float64]


def one_ring(mesh: Mesh, i: int) -> tuple[list[int], list[tuple[int, int, int]]]:
    """The neighbours of vertex i and the triangles round it."""
    triangles = [tuple(int(v) for v in face) for face in mesh.faces if i in face]
    return sorted({v for face in triangles for v in face} - {i}), triangles


def area(vertices: FloatArray, triangle: tuple[int, int, int]) -> float:
    """Heron's formula in its stable form (1.1)."""
    p, q, r = (vertices[v] for v in triangle)
    a, b, c = sorted((np.linalg.norm(p - q), np.linalg.norm(q - r), np.linalg.norm(r - p)), reverse=True)
    return math.sqrt(max(0.0, (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c)))) / 4


def mean_edge(mesh: Mesh) -> float:
    """The mean edge length (1.4)."""
    pairs = {tuple(sorted((int(f[k]), int(f[k - 1])))) for f in mesh.faces for k in range(3)}
    return float(np.mean([np.linalg.norm(mesh.vertices[a] - mesh.vertices[b]) for a, b in pairs]))


def finite_volume(
    mesh: Mesh, *, floor: float, normal: str = "minor_eigenvector", scale: str = "median",
    anisotropy: bool = True,
) -> FloatArray:  # fmt: skip
    """Positions after one step of (3.1)-(3.5), every vertex free, (m, 3); METHOD §2 (d).

    floor: the least sigma, 1e-6 mean edge lengths of the mesh that the iteration began with.
    """
    v = mesh.vertices
    result = v.copy()
    around = [one_ring(mesh, i) for i in range(len(v))]
    ring_area = [sum(area(v, t) for t in triangles) for _, triangles in around]
    for i, (neighbours, triangles) in enumerate(around):
        if not triangles:
            continue
        mu = sum(ring_area[j] * v[j] for j in neighbours) / sum(ring_area[j] for j in neighbours)
        covariance = sum(np.outer(v[j] - mu, v[j] - mu) for j in neighbours)
        weighted = sum(np.cross(v[b] - v[a], v[c] - v[a]) for a, b, c in triangles)
        weighted = weighted / (np.linalg.norm(weighted) or 1.0)
        eigenvalues, eigenvectors = np.linalg.eigh(covariance)
        deviator = covariance - np.trace(covariance) / 3 * np.eye(3)
        n = eigenvectors[:, 0]
        spread = np.linalg.norm(deviator) / math.sqrt(6)
        if normal == "area_weighted" or eigenvalues[1] - eigenvalues[0] <= 1e-6 * spread:
            n = weighted
        elif n @ weighted < 0:
            n = -n
        centroids = [sum(v[k] for k in t) / 3 for t in triangles]
        r = np.array([(v[i] - c) @ n for c in centroids])
        if scale == "median":
            sigma = 1.4826 * np.median(np.abs(r - np.median(r)))
        else:
            sigma = math.sqrt(np.mean([(v[i] - c) @ (v[i] - c) for c in centroids]))
        sigma = max(sigma, floor)
        exponents = np.array([(v[i] - c) @ (v[i] - c) / (2 * sigma**2) for c in centroids])
        w = np.exp(-(exponents - exponents.min()))
        fraction = math.sqrt(1.5) * np.linalg.norm(deviator) / np.linalg.norm(covariance)
        if not anisotropy:
            fraction = 1.0
        result[i] = v[i] - fraction * (w @ r) / w.sum() * n
    return result


def laplacian(mesh: Mesh, step: float = 1.0) -> FloatArray:
    """Positions after one step of (1.8), every vertex free, (m, 3)."""
    result = mesh.vertices.copy()
    for i in range(len(result)):
        neighbours, _ = one_ring(mesh, i)
        if neighbours:
            differences = [(mesh.vertices[j] - mesh.vertices[i]) / len(neighbours) for j in neighbours]
            result[i] += step * sum(differences)
    return result


def visual_error(first: Mesh, second: Mesh) -> float:
    """E_2 (2.33) with the geometric Laplacian (2.34)."""
    total = 0.0
    for i in range(len(first.vertices)):
        neighbours, _ = one_ring(first, i)
        delta = first.vertices[i] - second.vertices[i]
        total += delta @ delta
        if neighbours:
            delta = delta - sum(first.vertices[j] - second.vertices[j] for j in neighbours) / len(neighbours)
        total += delta @ delta
    return total / (2 * len(first.vertices))


def unit(vector: FloatArray) -> FloatArray:
    """The vector at length 1; zero stays zero."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0 else vector


def normal(vertices: FloatArray, triangle: tuple[int, int, int]) -> FloatArray:
    """The unit normal of a triangle, zero without area."""
    p, q, r = (vertices[v] for v in triangle)
    return unit(np.cross(q - p, r - p))


def vertex_normal(mesh: Mesh, i: int, *, by_area: bool = False) -> FloatArray:
    """The mean of the normals round a vertex, normalised (1.3)."""
    v = mesh.vertices
    return unit(
        sum(normal(v, t) * (area(v, t) if by_area else 1.0) for t in one_ring(mesh, i)[1]) + np.zeros(3)
    )


def all_rings(mesh: Mesh) -> list[list[int]]:
    """The neighbours of each vertex."""
    return [one_ring(mesh, i)[0] for i in range(len(mesh.vertices))]


def within(rings: list[list[int]], i: int, hops: int) -> set[int]:
    """The vertices within ``hops`` edges of i, itself included."""
    found = {i}
    for _ in range(hops):
        found |= {j for v in found for j in rings[v]}
    return found


def normals_voting(mesh: Mesh, vote: str) -> FloatArray:
    """Positions after one step of (1.9)-(1.11), vote: "mean" or "angle_median"; every vertex free, (m, 3)."""
    v = mesh.vertices
    triangles = [tuple(int(x) for x in face) for face in mesh.faces]
    areas = [area(v, t) for t in triangles]
    normals = [normal(v, t) for t in triangles]
    voted = []
    for i, t in enumerate(triangles):
        others = [k for k, s in enumerate(triangles) if k != i and set(s) & set(t)]
        if vote == "mean":
            voted.append(unit(sum(areas[k] * normals[k] for k in others) + np.zeros(3)))
        else:
            def angle(k: int, own: FloatArray = normals[i]) -> float:
                return math.atan2(float(np.linalg.norm(np.cross(own, normals[k]))), float(own @ normals[k]))
            ordered = sorted(others, key=angle)
            voted.append(normals[ordered[(len(ordered) - 1) // 2]])
    result = v.copy()
    for i in range(len(v)):
        around = [k for k, t in enumerate(triangles) if i in t]
        if around:
            move = sum(
                areas[k] * ((sum(v[x] for x in triangles[k]) / 3 - v[i]) @ voted[k]) * voted[k] for k in around
            )
            result[i] += move / sum(areas[k] for k in around)
    return result


def weighted_laplacian(mesh: Mesh, step: float = 1.0, largest: float = 20 / math.sqrt(3)) -> FloatArray:
    """Positions after one step of (1.12) with clamped cotangents, every vertex free, (m, 3)."""
    v = mesh.vertices
    result = v.copy()
    for i in range(len(v)):
        neighbours, triangles = one_ring(mesh, i)
        move, total = np.zeros(3), 0.0
        for j in neighbours:
            w = 0.0
            for t in triangles:
                if j in t:
                    (k,) = set(t) - {i, j}
                    p, q = v[i] - v[k], v[j] - v[k]
                    w += p @ q / np.linalg.norm(np.cross(p, q))
            w = min(max(w, 0.0), largest)
            move += w * (v[j] - v[i])
            total += w
        if total > 0:
            result[i] += step * move / total
    return result


def bilateral(mesh: Mesh, reach: float = 1.0, sigma_s: float | None = None, *, by_area: bool = False) -> FloatArray:
    """Positions after one step of (1.13), every vertex free, (m, 3). sigma_s: in mean edge lengths."""
    v, length = mesh.vertices, mean_edge(mesh)
    rings = all_rings(mesh)
    result = v.copy()
    for i in range(len(v)):
        n = vertex_normal(mesh, i, by_area=by_area)
        ball, grown = {i}, True
        while grown:
            fresh = {j for k in ball for j in rings[k] if np.linalg.norm(v[j] - v[i]) < 2 * reach * length} - ball
            ball |= fresh
            grown = bool(fresh)
        others = sorted(ball - {i})
        if not others:
            continue
        h = np.array([n @ (v[j] - v[i]) for j in others])
        sigma = max(float(h.std()) if sigma_s is None else sigma_s * length, 1e-6 * length)
        near = np.array([(v[j] - v[i]) @ (v[j] - v[i]) for j in others])
        exponents = near / (2 * (reach * length) ** 2) + h**2 / (2 * sigma**2)
        w = np.exp(exponents.min() - exponents)
        result[i] = v[i] + n * (w @ h) / w.sum()
    return result


def anisotropic(mesh: Mesh, step: float = 0.25, c: float | None = None, *, literal: bool = False) -> FloatArray:
    """Positions after one step of (1.14)-(1.18), every vertex free, (m, 3). c: in mean edge lengths."""
    v, rings = mesh.vertices, all_rings(mesh)
    centre = v.mean(axis=0)
    d = [len(ring) for ring in rings]

    def difference(i: int, j: int) -> FloatArray:
        if literal:
            return (v[j] - centre) / math.sqrt(d[j]) - (v[i] - centre) / math.sqrt(d[i])
        return (v[j] - v[i]) / (d[i] * d[j]) ** 0.25

    gradient = np.array([math.sqrt(sum(difference(i, j) @ difference(i, j) for j in rings[i])) for i in range(len(v))])
    if c is not None:
        c = c * mean_edge(mesh)
    elif literal:
        c = 2.3849
    else:
        c = 2.3849 * 1.4826 * float(np.median(np.abs(gradient - np.median(gradient))))
    g = 1 / (1 + gradient**2 / c**2)
    result = v.copy()
    for i, ring in enumerate(rings):
        for j in ring:
            if literal:
                result[i] += difference(i, j) / math.sqrt(d[i]) * (g[i] + g[j])
            else:
                result[i] += step * (v[j] - v[i]) / math.sqrt(d[i] * d[j]) * (g[i] + g[j])
    return result


def noise_level(mesh: Mesh) -> float:
    """The standard deviation of the noise along the normals, from neighbours' offsets."""
    v, rings = mesh.vertices, all_rings(mesh)
    r = [vertex_normal(mesh, i) @ (v[i] - sum(v[j] for j in ring) / len(ring)) for i, ring in enumerate(rings)]
    found = []
    for i, ring in enumerate(rings):
        for j in ring:
            if i < j:
                row = dict.fromkeys((i, j, *ring, *rings[j]), 0.0)
                for end, sign in ((i, 1), (j, -1)):
                    row[end] += sign
                    for k in rings[end]:
                        row[k] -= sign / len(rings[end])
                found.append(abs(r[i] - r[j]) / math.sqrt(sum(x * x for x in row.values())))
    return 1.4826 * float(np.median(found))


def graph_diffusion(
    mesh: Mesh, start: FloatArray, *, weights: str = "local", p: float = 1.0, step: float = 0.9,
    fitting: float | None = 0.0, sigma: float = 0.0, literal: bool = False,
) -> FloatArray:  # fmt: skip
    """Positions after one step of (2.19)-(2.24), or "uniform", every vertex free, (m, 3).

    start: phi_0. fitting: lambda, or None for Morozov's with the noise ``sigma``.
    """
    v, rings = mesh.vertices, all_rings(mesh)
    m = len(v)
    rows = [sorted(within(rings, i, 2) - {i}) for i in range(m)] if weights == "nonlocal" else rings
    spread = np.mean([(v[j] - v[i]) @ (v[j] - v[i]) for i in range(m) for j in rings[i]])
    patch = []
    for i in range(m):
        h = np.array([vertex_normal(mesh, i) @ (v[j] - v[i]) for j in rings[i]])
        patch.append(np.array([h.mean(), math.sqrt((h**2).mean())]))
    alike = np.mean([(patch[i] - patch[j]) @ (patch[i] - patch[j]) for i in range(m) for j in rows[i]])

    def weight(i: int, j: int) -> float:
        if weights == "uniform":
            return 1 / len(rings[i])
        exponent = (v[i] - v[j]) @ (v[i] - v[j]) / spread
        if weights == "nonlocal":
            exponent += (patch[i] - patch[j]) @ (patch[i] - patch[j]) / alike
        return math.exp(-exponent)

    gradient = np.array([
        math.sqrt(sum(weight(i, j) * (v[j] - v[i]) @ (v[j] - v[i]) for j in rows[i])) for i in range(m)
    ])  # fmt: skip
    g = (gradient**2 + (1e-3 * np.median(gradient)) ** 2) ** ((p - 2) / 2)
    flow, totals = np.zeros((m, 3)), np.zeros(m)
    for i in range(m):
        for j in rows[i]:
            w = (math.sqrt(weight(i, j)) if literal else weight(i, j)) * (g[i] + g[j])
            flow[i] += w * (v[j] - v[i])
            totals[i] += w

    def moved(strength: float) -> FloatArray:
        return v + step / (totals.max() + strength) * (flow + strength * (start - v))

    if fitting is not None:
        return moved(fitting)

    def excess(strength: float) -> float:
        return float(((moved(strength) - start) ** 2).sum()) - m * sigma**2

    if excess(0.0) <= 0:
        return moved(0.0)
    low, high = 0.0, 1.0
    while excess(high) > 0:
        high *= 2
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return moved(high)


def kernel(mesh: Mesh, kappa: float = 0.45, *, start: FloatArray | None = None, fitting: float = 0.0) -> FloatArray:
    """Positions after one step of (2.26)-(2.32), every vertex free, (m, 3)."""
    v, ridge = mesh.vertices, kappa * mean_edge(mesh) ** 2
    result = v.copy()
    for i, ring in enumerate(all_rings(mesh)):
        centre = sum(v[j] for j in ring) / len(ring)
        h = sum(np.outer(v[j] - centre, v[j] - centre) for j in ring) + ridge * np.eye(3)
        row = {
            j: np.linalg.det(h) ** -0.5 * (2 * math.pi) ** -1.5
            * math.exp(-0.5 * (v[i] - v[j]) @ np.linalg.inv(h) @ (v[i] - v[j]))
            for j in (i, *ring)
        }  # fmt: skip
        mean = sum(w * v[j] for j, w in row.items()) / sum(row.values())
        back = fitting * ((v if start is None else start)[i] - v[i])
        result[i] = v[i] + (mean - v[i] + back) / (1 + fitting)
    return result


def multiscale_anisotropic(mesh: Mesh, step: float = 1.0, scales: int = 2, c: float | None = None) -> FloatArray:
    """Positions after one step, every vertex free, (m, 3)."""
    v, rings = mesh.vertices, all_rings(mesh)
    m = len(v)
    sums = [sum(area(v, t) * normal(v, t) for t in one_ring(mesh, i)[1]) for i in range(m)]
    rho = np.empty(m)
    for i in range(m):
        scale = [unit(sum(sums[j] for j in within(rings, i, k))) for k in range(scales + 1)]
        rho[i] = min(np.linalg.norm(scale[k] - scale[k - 1]) for k in range(1, scales + 1))
    c = 2.3849 * 1.4826 * float(np.median(rho)) if c is None else c
    g = 1 / (1 + rho**2 / c**2)
    result = v.copy()
    for i, ring in enumerate(rings):
        flow = sum((g[i] + g[j]) / (2 * len(ring)) * (v[j] - v[i]) for j in ring)
        n = unit(sums[i])
        result[i] += step * (flow @ n) * n
    return result


def following(mesh: Mesh, normals: list[FloatArray], moves: int) -> FloatArray:
    """Positions after ``moves`` steps of Sun et al. (2007) towards the normals of the faces, (m, 3)."""
    v = mesh.vertices.copy()
    triangles = [[int(x) for x in face] for face in mesh.faces]
    for _ in range(moves):
        result = v.copy()
        for i in range(len(v)):
            around = [k for k, t in enumerate(triangles) if i in t]
            heights = [((v[triangles[k]].mean(axis=0) - v[i]) @ normals[k]) * normals[k] for k in around]
            if around:
                result[i] += sum(heights) / len(around)
        v = result
    return v


def near_faces(mesh: Mesh) -> tuple[list[list[int]], list[tuple[int, int]]]:
    """The other faces that share a vertex with each face, and the pairs of faces that alone share an edge."""
    sets = [set(map(int, face)) for face in mesh.faces]
    near = [[k for k, s in enumerate(sets) if k != i and s & t] for i, t in enumerate(sets)]
    across: list[tuple[int, int]] = []
    for i, t in enumerate(sets):
        shared = {k: sets[k] & t for k in near[i] if k > i}
        across += [(i, k) for k, edge in shared.items() if len(edge) == 2 and sum(edge <= s for s in sets) == 2]
    return near, across


def bilateral_mean(
    mesh: Mesh, normals: list[FloatArray], guides: list[FloatArray], sigma_s: float, reach: float
) -> list[FloatArray]:
    """Each face's normal after one pass of the joint bilateral filter of normals."""
    near, across = near_faces(mesh)
    centroids = [mesh.vertices[face].mean(axis=0) for face in mesh.faces]
    areas = [area(mesh.vertices, tuple(face)) for face in mesh.faces]
    sigma_c = reach * np.mean([np.linalg.norm(centroids[s] - centroids[t]) for s, t in across])
    result = []
    for t in range(len(normals)):
        total = np.zeros(3)
        for s in near[t]:
            far, other = centroids[s] - centroids[t], guides[s] - guides[t]
            total += areas[s] * math.exp(-far @ far / (2 * sigma_c**2) - other @ other / (2 * sigma_s**2)) * normals[s]
        result.append(unit(total))
    return result


def bilateral_normal(
    mesh: Mesh, sigma_s: float = 0.6, reach: float = 1.0, normal_iterations: int = 5, vertex_iterations: int = 10
) -> FloatArray:
    """Positions after one round of Zheng et al. (2011), local scheme, every vertex free, (m, 3)."""
    normals = [normal(mesh.vertices, tuple(face)) for face in mesh.faces]
    for _ in range(normal_iterations):
        normals = bilateral_mean(mesh, normals, normals, sigma_s, reach)
    return following(mesh, normals, vertex_iterations)


def fast_effective(
    mesh: Mesh, threshold: float = 0.1, normal_iterations: int = 5, vertex_iterations: int = 10
) -> FloatArray:
    """Positions after one round of Sun et al. (2007), every vertex free, (m, 3)."""
    near, _ = near_faces(mesh)
    normals = [normal(mesh.vertices, tuple(face)) for face in mesh.faces]
    for _ in range(normal_iterations):
        normals = [
            unit(sum(max(0.0, float(normals[s] @ n) - threshold) ** 2 * normals[s] for s in (t, *near[t])))
            for t, n in enumerate(normals)
        ]
    return following(mesh, normals, vertex_iterations)


def guided_normal(
    mesh: Mesh, sigma_s: float = 0.5, reach: float = 1.0, normal_iterations: int = 5, vertex_iterations: int = 10
) -> FloatArray:
    """Positions after one round of Zhang et al. (2015), local scheme, every vertex free, (m, 3)."""
    near, across = near_faces(mesh)
    for _ in range(normal_iterations):
        normals = [normal(mesh.vertices, tuple(face)) for face in mesh.faces]
        areas = [area(mesh.vertices, tuple(face)) for face in mesh.faces]
        unevenness, means = [], []
        for t in range(len(normals)):
            patch = {t, *near[t]}
            widest = max(np.linalg.norm(normals[s] - normals[r]) for s in patch for r in patch)
            phi = [np.linalg.norm(normals[s] - normals[r]) for s, r in across if s in patch and r in patch]
            unevenness.append(widest * max(phi, default=0.0) / (1e-9 + sum(phi)))
            means.append(unit(sum(areas[s] * normals[s] for s in patch)))
        guides = [means[min((t, *near[t]), key=lambda s: unevenness[s])] for t in range(len(normals))]
        normals = bilateral_mean(mesh, normals, guides, sigma_s, reach)
        mesh = Mesh(following(mesh, normals, vertex_iterations), mesh.faces)
    return mesh.vertices


def taubin(mesh: Mesh, step: float = 0.5, pass_band: float = 0.1) -> FloatArray:
    """Positions after one pair of steps of Taubin (1995), every vertex free, (m, 3)."""
    once = Mesh(laplacian(mesh, step), mesh.faces)
    return laplacian(once, 1 / (pass_band - 1 / step))


def fairing(mesh: Mesh, time: float = 0.5, largest: float = 20 / math.sqrt(3)) -> FloatArray:
    """Positions after one implicit step of Desbrun et al. (1999), volume not kept, every vertex free, (m, 3)."""
    v = mesh.vertices
    mass, stiffness = np.zeros((len(v), len(v))), np.zeros((len(v), len(v)))
    for i in range(len(v)):
        neighbours, triangles = one_ring(mesh, i)
        mass[i, i] = sum(area(v, t) for t in triangles) / 3
        for j in neighbours:
            w = 0.0
            for t in triangles:
                if j in t:
                    (k,) = set(t) - {i, j}
                    p, q = v[i] - v[k], v[j] - v[k]
                    w += p @ q / np.linalg.norm(np.cross(p, q))
            w = min(max(w, 0.0), largest) / 2
            stiffness[i, i] += w
            stiffness[i, j] -= w
    return np.linalg.solve(mass + time * mean_edge(mesh) ** 2 * stiffness, mass @ v)


def bilateral_normal_global(
    mesh: Mesh, sigma_s: float = 0.6, reach: float = 1.0, fidelity: float = 0.01, vertex_iterations: int = 10
) -> FloatArray:
    """Positions after the global scheme of Zheng et al. (2011), by a dense least-squares matrix, (m, 3)."""
    near, across = near_faces(mesh)
    normals = np.array([normal(mesh.vertices, tuple(face)) for face in mesh.faces])
    centroids = [mesh.vertices[face].mean(axis=0) for face in mesh.faces]
    areas = np.array([area(mesh.vertices, tuple(face)) for face in mesh.faces])
    sigma_c = reach * np.mean([np.linalg.norm(centroids[s] - centroids[t]) for s, t in across])
    apart = np.eye(len(normals))
    for t in range(len(normals)):
        weights = {}
        for s in near[t]:
            far, other = centroids[s] - centroids[t], normals[s] - normals[t]
            weights[s] = areas[s] * math.exp(-far @ far / (2 * sigma_c**2) - other @ other / (2 * sigma_s**2))
        for s, weight in weights.items():
            apart[t, s] -= weight / sum(weights.values())
    matrix = (1 - fidelity) * apart.T @ np.diag(areas) @ apart + fidelity * np.diag(areas)
    found = np.linalg.solve(matrix, fidelity * areas[:, None] * normals)
    return following(mesh, [unit(one) for one in found], vertex_iterations)


def l0(mesh: Mesh, flatness: float = 0.2) -> FloatArray:
    """Positions after the minimisation of He and Schaefer (2013), by dense matrices, (m, 3)."""
    edge = mean_edge(mesh)
    start = mesh.vertices / edge
    hinges: list[tuple[int, int, int, int]] = []
    for one in mesh.faces:
        for k in range(3):
            p3, p1, p2 = (int(one[(k + j) % 3]) for j in range(3))
            beside = [set(map(int, f)) for f in mesh.faces if {p1, p3} <= set(map(int, f))]
            others = [s - {p1, p3} for s in beside if p2 not in s]
            seen = {frozenset((hinge[0], hinge[2])) for hinge in hinges}
            if len(beside) == 2 and len(others) == 1 and frozenset((p1, p3)) not in seen:
                hinges.append((p1, p2, p3, others[0].pop()))

    def angle(hinge: tuple[int, int, int, int]) -> float:
        a, b, c, d = (start[i] for i in hinge)
        one, other = np.cross(b - a, c - a), np.cross(c - a, d - a)
        return math.atan2(float(np.linalg.norm(np.cross(one, other))), float(one @ other))

    gamma = float(np.mean([angle(hinge) for hinge in hinges]))
    p, beta, alpha = start, 1e-3, 0.1 * gamma
    skew = np.zeros((len(hinges), len(p)))
    for row, hinge in enumerate(hinges):
        skew[row, list(hinge)] = [1, -1, 1, -1]
    while beta < 1e3:
        bend = np.zeros_like(skew)
        for row, (i1, i2, i3, i4) in enumerate(hinges):
            p1, p2, p3, p4 = p[i1], p[i2], p[i3], p[i4]
            a, b = area(p, (i1, i2, i3)), area(p, (i1, i3, i4))
            scale = (p3 - p1) @ (p3 - p1) * (a + b)
            bend[row, i1] = (a * (p4 - p3) @ (p3 - p1) + b * (p1 - p3) @ (p3 - p2)) / scale
            bend[row, i3] = (a * (p3 - p1) @ (p1 - p4) + b * (p2 - p1) @ (p1 - p3)) / scale
            bend[row, i2], bend[row, i4] = b / (a + b), a / (a + b)
        delta = bend @ p
        delta[(delta**2).sum(axis=1) <= flatness * gamma / beta] = 0
        matrix = np.eye(len(p)) + beta * bend.T @ bend + alpha * skew.T @ skew
        p = np.linalg.solve(matrix, start + beta * bend.T @ delta)
        beta *= math.sqrt(2)
        alpha /= 2
    return p * edge
