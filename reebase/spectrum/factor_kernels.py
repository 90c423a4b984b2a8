"""Kernels of the factorisation: order by nested dissection, entries of L, panels of L, and solving with them.

Panel s holds the columns first[s] to first[s + 1] of L, new numbers, and the rows below them that are not zero,
rows[starts[s] : starts[s + 1]], sorted.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["dissect", "factorise", "fill_in", "places", "schedule", "solve"]

Float = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]
Int64 = npt.NDArray[np.int64]

POWERS = 8  # products with the covariance: any direction will do, the longest is the best
FAST = {"contract", "nsz", "reassoc"}


@njit(cache=True, nogil=True)
def places(pointers: Int32, indices: Int32, crowded: int) -> Float:
    """Points (m, 3) for a graph without any: steps from three vertices far apart; one component after another.

    Vertices with more than ``crowded`` neighbours are passed over and lie at the origin: through a hub all are near.
    """
    m = len(pointers) - 1
    points = np.zeros((m, 3))
    hub = np.diff(pointers) > crowded
    wanted = m - hub.sum()
    if wanted == 0:
        return points
    queue = np.empty(wanted, np.int32)
    source = int(hub.argmin())
    for axis in range(-1, 3):  # the first round only finds a vertex far out
        level = np.where(hub, np.int32(0), np.int32(-1))
        filled = done = 0
        begin, root = 0, source
        while True:
            level[root] = begin
            queue[filled] = root
            filled += 1
            while done < filled:
                v = queue[done]
                done += 1
                for at in range(pointers[v], pointers[v + 1]):
                    j = indices[at]
                    if level[j] < 0:
                        level[j] = level[v] + 1
                        queue[filled] = j
                        filled += 1
            if filled == wanted:
                break
            begin, root = level[queue[filled - 1]] + 2, 0
            while level[root] >= 0:
                root += 1
        if axis < 0:
            source = queue[wanted - 1]
            continue
        farthest = -1.0
        for v in queue:
            points[v, axis] = level[v]
            nearest = points[v, 0]
            for known in range(1, axis + 1):
                nearest = min(nearest, points[v, known])
            if nearest > farthest:
                farthest, source = nearest, v
    return points


@njit(cache=True, nogil=True)
def _longest(points: Float, part: Int32) -> tuple[float, float, float]:
    """About the direction in which the points of a part extend most."""
    mx = my = mz = 0.0
    for v in part:
        mx += points[v, 0]
        my += points[v, 1]
        mz += points[v, 2]
    mx, my, mz = mx / len(part), my / len(part), mz / len(part)
    xx = xy = xz = yy = yz = zz = 0.0
    for v in part:
        x, y, z = points[v, 0] - mx, points[v, 1] - my, points[v, 2] - mz
        xx += x * x
        xy += x * y
        xz += x * z
        yy += y * y
        yz += y * z
        zz += z * z
    a, b, c = xx, xy, xz
    if yy > xx and yy >= zz:
        a, b, c = xy, yy, yz
    elif zz > xx:
        a, b, c = xz, yz, zz
    for _ in range(POWERS):
        size = max(abs(a), abs(b), abs(c))
        if not size > 0.0:
            return 1.0, 0.0, 0.0
        a, b, c = a / size, b / size, c / size
        a, b, c = xx * a + xy * b + xz * c, xy * a + yy * b + yz * c, xz * a + yz * b + zz * c
    return a, b, c


@njit(cache=True, nogil=True)
def _select(part: Int32, key: Float, middle: int) -> None:
    """Put those with the ``middle`` smallest keys first (Hoare's quickselect)."""
    low, high = 0, len(part) - 1
    while low < high:
        pivot = key[part[(low + high) // 2]]
        i, j = low, high
        while i <= j:
            while key[part[i]] < pivot:
                i += 1
            while key[part[j]] > pivot:
                j -= 1
            if i <= j:
                part[i], part[j] = part[j], part[i]
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            return


@njit(cache=True, nogil=True)
def _beside(
    pointers: Int32, indices: Int32, part: Int32, label: Int32, other: int, beside: npt.NDArray[np.bool_]
) -> int:
    """Mark and count those of a part that have a neighbour with the other label."""
    count = 0
    for at in range(len(part)):
        v = part[at]
        beside[at] = False
        for e in range(pointers[v], pointers[v + 1]):
            if label[indices[e]] == other:
                beside[at] = True
                count += 1
                break
    return count


@njit(cache=True, nogil=True)
def _cut(
    pointers: Int32, indices: Int32, points: Float, part: Int32, label: Int32, fresh: int,
    key: Float, shelf: Int32, beside: npt.NDArray[np.bool_],
) -> tuple[int, int]:  # fmt: skip
    """Sort a part into two that are no neighbours, and their cut: where the second and the cut begin.

    ``fresh`` and the next are labels not in use; those in the cut get -1.
    """
    a, b, c = _longest(points, part)
    for v in part:
        key[v] = a * points[v, 0] + b * points[v, 1] + c * points[v, 2]
    half = len(part) // 2
    _select(part, key, half)
    near, far = part[:half], part[half:]
    for v in near:
        label[v] = fresh
    for v in far:
        label[v] = fresh + 1
    of_near = _beside(pointers, indices, near, label, fresh + 1, beside[:half])
    of_far = _beside(pointers, indices, far, label, fresh, beside[half : len(part)])
    first, stop = (0, half) if of_near < of_far else (half, len(part))
    kept, cut = first, 0
    for at in range(first, stop):
        v = part[at]
        if beside[at]:
            shelf[cut], label[v] = v, -1
            cut += 1
        else:
            part[kept] = v
            kept += 1
    if first == 0:
        for at in range(half, len(part)):
            part[at - cut] = part[at]
        half -= cut
    for at in range(cut):
        part[len(part) - cut + at] = shelf[at]
    return half, len(part) - cut


@njit(cache=True, nogil=True)
def dissect(pointers: Int32, indices: Int32, points: Float, leaf: int, crowded: int) -> tuple[Int32, Int32]:
    """Order of elimination (m,), and where its panels begin (count + 1,).

    Parts of at most ``leaf`` vertices are not cut; vertices with more than ``crowded`` neighbours come last.
    """
    m = len(pointers) - 1
    order, label, shelf = np.empty(m, np.int32), np.zeros(m, np.int32), np.empty(m, np.int32)
    key, beside, starts = np.empty(m), np.empty(m, np.bool_), np.zeros(m + 1, np.bool_)
    last, count = m, 0
    for v in range(m):
        if pointers[v + 1] - pointers[v] > crowded:
            last -= 1
            order[last], label[v] = v, -1
        else:
            order[count] = v
            count += 1
    starts[last] = starts[m] = True
    low, high, height, fresh = np.empty(64, np.int64), np.empty(64, np.int64), 1, 1
    low[0], high[0] = 0, last
    while height:
        height -= 1
        begin, end = low[height], high[height]
        starts[begin] = True
        if end - begin <= leaf:
            continue
        half, cut = _cut(pointers, indices, points, order[begin:end], label, fresh, key, shelf, beside)
        fresh += 2
        starts[begin + cut] = True
        low[height], high[height] = begin + half, begin + cut
        height += cut > half
        low[height], high[height] = begin, begin + half
        height += half > 0
    first = np.empty(m + 1, np.int32)
    count = 0
    for at in range(m + 1):
        if starts[at]:
            first[count] = at
            count += 1
    return order, first[:count].copy()


@njit(cache=True, nogil=True)
def _sort(values: Int32) -> None:
    """Shell's sort, with Ciura's gaps."""
    for gap in (1750, 701, 301, 132, 57, 23, 10, 4, 1):
        for at in range(gap, len(values)):
            value, before = values[at], at
            while before >= gap and values[before - gap] > value:
                values[before] = values[before - gap]
                before -= gap
            values[before] = value


@njit(cache=True, nogil=True)
def fill_in(pointers: Int32, indices: Int32, order: Int32, first: Int32) -> tuple[Int32, Int64, Int32, Int32, Int32]:
    """New number of each vertex; starts and rows of the panels; first child of each panel, and its next sibling.

    The parent of a panel is that of its first row: the one its front is added to.
    """
    m, count = len(order), len(first) - 1
    number, panel_of = np.empty(m, np.int32), np.empty(m, np.int32)
    for c in range(m):
        number[order[c]] = c
    for s in range(count):
        for c in range(first[s], first[s + 1]):
            panel_of[c] = s
    seen = np.full(m, -1, np.int32)
    child, sibling = np.full(count, -1, np.int32), np.full(count, -1, np.int32)
    starts, rows = np.zeros(count + 1, np.int64), np.empty(4 * m, np.int32)
    used = 0
    for s in range(count):
        if len(rows) - used < m:
            rows = np.concatenate((rows, np.empty(len(rows), np.int32)))
        begin, after = used, first[s + 1]
        for c in range(first[s], after):
            v = order[c]
            for e in range(pointers[v], pointers[v + 1]):
                r = number[indices[e]]
                if r >= after and seen[r] != s:
                    seen[r], rows[used] = s, r
                    used += 1
        below = child[s]
        while below >= 0:
            for at in range(starts[below], starts[below + 1]):
                r = rows[at]
                if r >= after and seen[r] != s:
                    seen[r], rows[used] = s, r
                    used += 1
            below = sibling[below]
        _sort(rows[begin:used])
        starts[s + 1] = used
        if used > begin:
            parent = panel_of[rows[begin]]
            sibling[s], child[parent] = child[parent], s
    return number, starts, rows[:used].copy(), child, sibling


@njit(cache=True, nogil=True)
def schedule(first: Int32, starts: Int64, child: Int32, sibling: Int32) -> tuple[Int32, Int64, int]:
    """The panels with children just before their parents, where each begins in L (count + 1,), and the most entries
    of fronts that wait for their parents at a time."""
    count = len(child)
    is_child = np.zeros(count, np.bool_)
    for s in child:
        below = s
        while below >= 0:
            is_child[below] = True
            below = sibling[below]
    todo, sequence = np.empty(count, np.int32), np.empty(count, np.int32)
    waiting, at = 0, count
    for s in range(count):
        if not is_child[s]:
            todo[waiting] = s
            waiting += 1
    while waiting:
        waiting -= 1
        s = todo[waiting]
        at -= 1
        sequence[at] = s
        below = child[s]
        while below >= 0:
            todo[waiting] = below
            waiting += 1
            below = sibling[below]
    panel = np.zeros(count + 1, np.int64)
    for s in range(count):
        width = first[s + 1] - first[s]
        panel[s + 1] = panel[s] + width * (width + starts[s + 1] - starts[s])
    height = highest = 0
    for s in sequence:
        below = child[s]
        while below >= 0:
            height -= (starts[below + 1] - starts[below]) ** 2
            below = sibling[below]
        height += (starts[s + 1] - starts[s]) ** 2
        highest = max(highest, height)
    return sequence, panel, highest


@njit(cache=True, nogil=True, fastmath=FAST)
def _eliminate(target: Float, P: Float, signs: Float, count: int, j: int, skip: int) -> None:
    """target[j:] -= sum_k Q[k, j] signs[k] Q[k, j:] for k < count, Q being P without ``skip`` columns."""
    at, k = j + skip, 0
    while k + 4 <= count:
        a, b = P[k, at] * signs[k], P[k + 1, at] * signs[k + 1]
        c, d = P[k + 2, at] * signs[k + 2], P[k + 3, at] * signs[k + 3]
        pa, pb, pc, pd = P[k], P[k + 1], P[k + 2], P[k + 3]
        for i in range(j, len(target)):
            target[i] -= a * pa[i + skip] + b * pb[i + skip] + c * pc[i + skip] + d * pd[i + skip]
        k += 4
    while k < count:
        a, pa = P[k, at] * signs[k], P[k]
        for i in range(j, len(target)):
            target[i] -= a * pa[i + skip]
        k += 1


@njit(cache=True, nogil=True)
def factorise(
    pointers: Int32, indices: Int32, values: Float, shift: Float, order: Int32, first: Int32, starts: Int64,
    rows: Int32, panel: Int64, number: Int32, child: Int32, sibling: Int32, sequence: Int32, height: int,
) -> tuple[Float, Float, int]:  # fmt: skip
    """L by panels, row after row of each; S (m,); the vertex whose pivot vanished, or -1.

    On the diagonal of L stands one over it. A front is P, the rows of the upper triangle that this panel eliminates,
    over U, those left to its parent; U waits on a stack.
    """
    m, widest, longest = len(order), 0, 0
    for s in range(len(first) - 1):
        widest = max(widest, starts[s + 1] - starts[s])
        longest = max(longest, panel[s + 1] - panel[s])
    L, signs, stack = np.empty(panel[-1]), np.empty(m), np.empty(height)
    for_P, for_U, place, top = np.empty(longest), np.empty(widest * widest), np.empty(m, np.int32), 0
    for s in sequence:
        begin, width, below = first[s], first[s + 1] - first[s], rows[starts[s] : starts[s + 1]]
        size, left = width + len(below), len(below) ** 2
        P, U = for_P[: width * size].reshape(width, size), for_U[:left].reshape(len(below), len(below))
        for_P[: width * size] = 0.0
        for_U[:left] = 0.0
        for k in range(width):
            place[begin + k] = k
        for k in range(len(below)):
            place[below[k]] = width + k
        for k in range(width):
            v = order[begin + k]
            for e in range(pointers[v], pointers[v + 1]):
                j = number[indices[e]]
                if j >= begin + k:
                    P[k, place[j]] += values[e]
            P[k, k] += shift[v]
        top = _gather(P, U, stack, top, place, starts, rows, child[s], sibling)
        failed = _reduce(P, U, signs[begin : begin + width])
        if failed >= 0:
            return L, signs, order[begin + failed]
        stack[top : top + left] = for_U[:left]
        top += left
        _turn(P, L[panel[s] : panel[s + 1]])
    return L, signs, -1


@njit(cache=True, nogil=True)
def _turn(P: Float, Q: Float) -> None:
    """Q, flat, becomes the transpose of P."""
    width, size = P.shape
    for i in range(size):
        for k in range(width):
            Q[i * width + k] = P[k, i]


@njit(cache=True, nogil=True)
def _reduce(P: Float, U: Float, signs: Float) -> int:
    """Eliminate the rows of P from P and U; the row whose pivot vanished, or -1."""
    width = len(P)
    for k in range(width):
        _eliminate(P[k], P, signs, k, k, 0)
        pivot = P[k, k]
        if not 0.0 < abs(pivot) < np.inf:
            return k
        signs[k] = math.copysign(1.0, pivot)
        inverse = 1.0 / math.sqrt(abs(pivot))
        P[k, k] = inverse
        for i in range(k + 1, P.shape[1]):
            P[k, i] *= inverse * signs[k]
    for k in range(len(U)):
        _eliminate(U[k], P, signs, width, k, width)
    return -1


@njit(cache=True, nogil=True)
def _gather(
    P: Float, U: Float, stack: Float, top: int, place: Int32, starts: Int64, rows: Int32, child: int, sibling: Int32
) -> int:
    """Add the fronts of the children, which are on top of the stack, the first lowest; the new top."""
    below = child
    while below >= 0:
        top -= (starts[below + 1] - starts[below]) ** 2
        below = sibling[below]
    at, width, below = top, len(P), child
    while below >= 0:
        theirs = rows[starts[below] : starts[below + 1]]
        V = stack[at : at + len(theirs) ** 2].reshape(len(theirs), len(theirs))
        at += len(theirs) ** 2
        for i in range(len(theirs)):
            k = place[theirs[i]]
            if k < width:
                for j in range(i, len(theirs)):
                    P[k, place[theirs[j]]] += V[i, j]
            else:
                for j in range(i, len(theirs)):
                    U[k - width, place[theirs[j]] - width] += V[i, j]
        below = sibling[below]
    return top


@njit(cache=True, nogil=True, fastmath=FAST)
def solve(
    order: Int32, first: Int32, starts: Int64, rows: Int32, panel: Int64, L: Float, signs: Float, scale: Float, b: Float
) -> Float:  # fmt: skip
    """D (L S L^T)^-1 D b for four rows b (4, m), with D = diag(scale)."""
    X = np.empty((len(order), 4))
    for c in range(len(order)):
        v, a = order[c], scale[order[c]]
        X[c, 0], X[c, 1], X[c, 2], X[c, 3] = a * b[0, v], a * b[1, v], a * b[2, v], a * b[3, v]
    for s in range(len(first) - 1):
        begin, width, below = first[s], first[s + 1] - first[s], rows[starts[s] : starts[s + 1]]
        Q = L[panel[s] : panel[s + 1]].reshape(width + len(below), width)
        _forward(Q, X[begin : begin + width], X, below)
    for s in range(len(first) - 2, -1, -1):
        begin, width, below = first[s], first[s + 1] - first[s], rows[starts[s] : starts[s + 1]]
        Q, y = L[panel[s] : panel[s + 1]].reshape(width + len(below), width), X[begin : begin + width]
        for k in range(width):
            a = signs[begin + k]
            y[k, 0], y[k, 1], y[k, 2], y[k, 3] = a * y[k, 0], a * y[k, 1], a * y[k, 2], a * y[k, 3]
        _backward(Q, y, X, below)
    solution = np.empty(b.shape)
    for c in range(len(order)):
        v, a, x = order[c], scale[order[c]], X[c]
        solution[0, v], solution[1, v], solution[2, v], solution[3, v] = a * x[0], a * x[1], a * x[2], a * x[3]
    return solution


@njit(cache=True, nogil=True, fastmath=FAST)
def _forward(Q: Float, y: Float, X: Float, below: Int32) -> None:
    """Solve with the triangle on top of the panel Q for y, and take what is below it times y from X; rows in twos."""
    width = len(y)
    for i in range(width):
        s0, s1, s2, s3 = y[i, 0], y[i, 1], y[i, 2], y[i, 3]
        for k in range(i):
            a = Q[i, k]
            s0, s1, s2, s3 = s0 - a * y[k, 0], s1 - a * y[k, 1], s2 - a * y[k, 2], s3 - a * y[k, 3]
        a = Q[i, i]
        y[i, 0], y[i, 1], y[i, 2], y[i, 3] = a * s0, a * s1, a * s2, a * s3
    for i in range(0, len(below) - 1, 2):
        p, q, x, z = Q[width + i], Q[width + i + 1], X[below[i]], X[below[i + 1]]
        s0, s1, s2, s3 = x[0], x[1], x[2], x[3]
        t0, t1, t2, t3 = z[0], z[1], z[2], z[3]
        for k in range(width):
            a, b = p[k], q[k]
            y0, y1, y2, y3 = y[k, 0], y[k, 1], y[k, 2], y[k, 3]
            s0, s1, s2, s3 = s0 - a * y0, s1 - a * y1, s2 - a * y2, s3 - a * y3
            t0, t1, t2, t3 = t0 - b * y0, t1 - b * y1, t2 - b * y2, t3 - b * y3
        x[0], x[1], x[2], x[3] = s0, s1, s2, s3
        z[0], z[1], z[2], z[3] = t0, t1, t2, t3
    if len(below) % 2:
        p, x = Q[len(Q) - 1], X[below[-1]]
        s0, s1, s2, s3 = x[0], x[1], x[2], x[3]
        for k in range(width):
            a = p[k]
            s0, s1, s2, s3 = s0 - a * y[k, 0], s1 - a * y[k, 1], s2 - a * y[k, 2], s3 - a * y[k, 3]
        x[0], x[1], x[2], x[3] = s0, s1, s2, s3


@njit(cache=True, nogil=True, fastmath=FAST)
def _backward(Q: Float, y: Float, X: Float, below: Int32) -> None:
    """Take the transpose of what is below the triangle of Q times X from y, and solve with the triangle's transpose."""
    width = len(y)
    for i in range(0, len(below) - 1, 2):
        p, q, x, z = Q[width + i], Q[width + i + 1], X[below[i]], X[below[i + 1]]
        s0, s1, s2, s3 = x[0], x[1], x[2], x[3]
        t0, t1, t2, t3 = z[0], z[1], z[2], z[3]
        for k in range(width):
            a, b = p[k], q[k]
            y0, y1, y2, y3 = y[k, 0], y[k, 1], y[k, 2], y[k, 3]
            y0, y1 = y0 - (a * s0 + b * t0), y1 - (a * s1 + b * t1)
            y2, y3 = y2 - (a * s2 + b * t2), y3 - (a * s3 + b * t3)
            y[k, 0], y[k, 1], y[k, 2], y[k, 3] = y0, y1, y2, y3
    for i in range(width - 1 + len(below) % 2, -1, -1):
        own = i < width
        p, x = (Q[i], y[i]) if own else (Q[len(Q) - 1], X[below[-1]])
        a = p[i] if own else 1.0
        s0, s1, s2, s3 = a * x[0], a * x[1], a * x[2], a * x[3]
        x[0], x[1], x[2], x[3] = s0, s1, s2, s3
        for k in range(min(i, width)):
            a = p[k]
            y0, y1, y2, y3 = y[k, 0], y[k, 1], y[k, 2], y[k, 3]
            y[k, 0], y[k, 1], y[k, 2], y[k, 3] = y0 - a * s0, y1 - a * s1, y2 - a * s2, y3 - a * s3
