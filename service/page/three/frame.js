// From where a shape is looked at first: its longest axis to the right, its shortest to the viewer, a little tilted.
// The same rule as that of the pictures that the server makes, so that a thumbnail and its shape agree.

/** Eigenvectors (columns, by rising eigenvalue) of a symmetric 3 × 3 matrix, by Jacobi's rotations. */
export function axes(matrix) {
  const a = matrix.map((row) => [...row]);
  const v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let sweep = 0; sweep < 24; sweep += 1) {
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
      if (Math.abs(a[p][q]) < 1e-300) continue;
      const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
      const t = (theta >= 0 ? 1 : -1) / (Math.abs(theta) + Math.hypot(theta, 1));
      const c = 1 / Math.hypot(t, 1);
      const s = t * c;
      for (let k = 0; k < 3; k += 1) [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
      for (let k = 0; k < 3; k += 1) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
      for (let k = 0; k < 3; k += 1) [v[k][p], v[k][q]] = [c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]];
    }
  }
  return [0, 1, 2].sort((i, j) => a[i][i] - a[j][j]).map((i) => v.map((row) => row[i]));
}

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** Of each face its centre, from the first corner of all, and its area as weight. */
function pieces(positions, faces) {
  const origin = positions.slice(0, 3);
  const centres = new Float64Array(faces.length);
  const weights = new Float64Array(faces.length / 3);
  let total = 0;
  for (let face = 0; face < weights.length; face += 1) {
    const [p, q, r] = [0, 1, 2].map((k) => [0, 1, 2].map((x) => positions[3 * faces[3 * face + k] + x] - origin[x]));
    const normal = cross([q[0] - p[0], q[1] - p[1], q[2] - p[2]], [r[0] - p[0], r[1] - p[1], r[2] - p[2]]);
    weights[face] = Math.hypot(...normal);
    total += weights[face];
    for (let x = 0; x < 3; x += 1) centres[3 * face + x] = (p[x] + q[x] + r[x]) / 3;
  }
  return { centres, weights: weights.map((weight) => weight / (total || 1)) };
}

function spread(centres, weights) {
  const mean = [0, 0, 0];
  weights.forEach((weight, i) => mean.forEach((_, x) => { mean[x] += weight * centres[3 * i + x]; }));
  const matrix = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
  weights.forEach((weight, i) => {
    for (let x = 0; x < 3; x += 1) centres[3 * i + x] -= mean[x];
    for (let x = 0; x < 3; x += 1)
      for (let y = 0; y < 3; y += 1) matrix[x][y] += weight * centres[3 * i + x] * centres[3 * i + y];
  });
  return matrix;
}

/** An axis turned so that the heavier tail of the surface lies along it. */
function turned(axis, centres, weights) {
  let skew = 0;
  let square = 0;
  weights.forEach((weight, i) => {
    const along = axis[0] * centres[3 * i] + axis[1] * centres[3 * i + 1] + axis[2] * centres[3 * i + 2];
    skew += weight * along ** 3;
    square += weight * along ** 2;
  });
  const largest = axis.reduce((most, value) => (Math.abs(value) > Math.abs(most) ? value : most));
  const sign = Math.abs(skew) > 1e-6 * square ** 1.5 ? Math.sign(skew) : Math.sign(largest);
  return axis.map((value) => value * sign);
}

/** The directions right, up and towards the viewer, as rows. */
export function principalFrame(positions, faces) {
  const { centres, weights } = pieces(positions, faces);
  const [, middle, longest] = axes(spread(centres, weights));
  const right = turned(longest, centres, weights);
  const up = turned(middle, centres, weights);
  return tilted([right, up, cross(right, up)]);
}

/** 18° about the upward axis, then 22° about the one to the right: no shape is seen exactly edge-on. */
function tilted([right, up, towards]) {
  const [a, b] = [(-18 * Math.PI) / 180, (22 * Math.PI) / 180];
  const mix = (x, y, z) => [0, 1, 2].map((i) => x * right[i] + y * up[i] + z * towards[i]);
  return [
    mix(Math.cos(a), 0, Math.sin(a)),
    mix(Math.sin(b) * Math.sin(a), Math.cos(b), -Math.sin(b) * Math.cos(a)),
    mix(-Math.cos(b) * Math.sin(a), Math.sin(b), Math.cos(b) * Math.cos(a)),
  ];
}

/** The rotation, as rows, that brings points nearest to their partners (Horn 1987), both about their own centres. */
export function rotationOnto(points, partners) {
  const centred = (rows) => {
    const mean = [0, 1, 2].map((x) => rows.reduce((sum, row) => sum + row[x], 0) / rows.length);
    return rows.map((row) => row.map((value, x) => value - mean[x]));
  };
  const [from, to] = [centred(points), centred(partners)];
  const s = [0, 1, 2].map((i) => [0, 1, 2].map((j) => from.reduce((sum, row, k) => sum + row[i] * to[k][j], 0)));
  const n = [
    [s[0][0] + s[1][1] + s[2][2], s[1][2] - s[2][1], s[2][0] - s[0][2], s[0][1] - s[1][0]],
    [s[1][2] - s[2][1], s[0][0] - s[1][1] - s[2][2], s[0][1] + s[1][0], s[2][0] + s[0][2]],
    [s[2][0] - s[0][2], s[0][1] + s[1][0], s[1][1] - s[0][0] - s[2][2], s[1][2] + s[2][1]],
    [s[0][1] - s[1][0], s[2][0] + s[0][2], s[1][2] + s[2][1], s[2][2] - s[0][0] - s[1][1]],
  ];
  // The largest eigenvalue's vector, by powers of the matrix moved to be positive.
  const shift = Math.max(...n.map((row) => row.reduce((sum, value) => sum + Math.abs(value), 0))) || 1;
  let q = [1, 0.1, 0.2, 0.3];
  for (let step = 0; step < 400; step += 1) {
    const next = n.map((row, i) => row.reduce((sum, value, j) => sum + value * q[j], shift * q[i]));
    const length = Math.hypot(...next);
    q = next.map((value) => value / length);
  }
  const [w, x, y, z] = q;
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
}

/** A rotation after another, as rows. */
export const after = (second, first) => second.map((row) =>
  [0, 1, 2].map((j) => row.reduce((sum, value, k) => sum + value * first[k][j], 0)));

