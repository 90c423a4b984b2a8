// A mesh for display and its scalars, as the API sends them: an uncompressed GLB with one primitive.

import { bytes } from "../parts/api.js";

const MAGIC = 0x46546c67;
const KINDS = { 5126: Float32Array, 5125: Uint32Array, 5123: Uint16Array };
const WIDTHS = { SCALAR: 1, VEC3: 3 };

/**
 * The display mesh at `address` (a shape's or a query's task):
 * { positions, before, faces, offset, fields: [{ name, title, description, scale, unit, values }], facesOfAll }.
 * positions and before, the same mesh as it was before denoising, are less the offset; with it they are in the file's units.
 */
export async function loadDisplay(address, signal) {
  return fromGlb(await bytes(`${address}/display`, signal));
}

export function fromGlb(buffer) {
  const view = new DataView(buffer);
  if (view.getUint32(0, true) !== MAGIC) throw new Error("The service sent a mesh that is no GLB.");
  const jsonLength = view.getUint32(12, true);
  const document = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 20, jsonLength)));
  const start = 20 + jsonLength + 8;
  const read = (index) => {
    const accessor = document.accessors[index];
    const part = document.bufferViews[accessor.bufferView];
    return new KINDS[accessor.componentType](buffer, start + (part.byteOffset ?? 0) + (accessor.byteOffset ?? 0),
      accessor.count * WIDTHS[accessor.type]);
  };
  const { attributes, indices, targets } = document.meshes[0].primitives[0];
  const { fields = [], faces } = document.asset.extras ?? {};
  const positions = read(attributes.POSITION);
  return {
    positions, faces: new Uint32Array(read(indices)), before: targets ? sum(positions, read(targets[0].POSITION)) : null,
    offset: document.nodes[0].translation ?? [0, 0, 0], facesOfAll: faces ?? null,
    fields: fields.map((field) => ({ ...field, scale: field.kind === "signed" ? "signed" : "sequential", values: values(field.attribute, attributes, read) })),
  };
}

const sum = (positions, moves) => positions.map((value, i) => value + moves[i]);

/** A scalar at each vertex, NaN where it has none. */
function values(name, attributes, read) {
  const missing = attributes[`${name}_MISSING`];
  const all = read(attributes[name]);
  if (missing === undefined) return all;
  const gone = read(missing);
  return all.map((value, i) => (gone[i] > 0.5 ? NaN : value));
}
