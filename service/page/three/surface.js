// A surface and its skeleton as things to draw: shading, colours of a scalar with its level sets, glass.

import {
  Box3, BufferAttribute, BufferGeometry, CylinderGeometry, DoubleSide, Group, InstancedMesh, Matrix4, Mesh,
  MeshBasicMaterial, Quaternion, ShaderMaterial, SphereGeometry, Vector3,
} from "../vendor/three.module.min.js";
import { glassEdge, rgb, SCALES, SKIN } from "./colours.js";
import { principalFrame } from "./frame.js";

const NOTHING = -1e30;
const LEVELS = 24;
const CELLS = 48;
const MANY_FACES = 30_000;

const VERTEX = `
attribute float value;
varying vec3 seen;
varying float scalar;
void main() {
  scalar = value;
  seen = normalMatrix * normal;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

const FRAGMENT = `
uniform vec3 skin;
uniform vec3 stops[5];
uniform vec2 range;
uniform float coloured;
uniform float levels;
uniform float glass;
uniform vec3 edge;
varying vec3 seen;
varying float scalar;
vec3 ramp(float t) {
  float at = clamp(t, 0.0, 1.0) * 4.0;
  vec3 c = mix(stops[0], stops[1], clamp(at, 0.0, 1.0));
  c = mix(c, stops[2], clamp(at - 1.0, 0.0, 1.0));
  c = mix(c, stops[3], clamp(at - 2.0, 0.0, 1.0));
  return mix(c, stops[4], clamp(at - 3.0, 0.0, 1.0));
}
void main() {
  vec3 n = normalize(seen);
  if (!gl_FrontFacing) n = -n;
  vec3 c = skin;
  if (coloured > 0.5 && scalar > -1e29) {
    float t = (scalar - range.x) / max(range.y - range.x, 1e-30);
    c = ramp(t);
    float s = t * levels;
    float away = abs(fract(s - 0.5) - 0.5) / max(fwidth(s), 1e-6);
    if (levels > 0.0) c *= mix(0.45, 1.0, smoothstep(0.4, 1.4, away));
  }
  float light = 0.42 * max(n.z, 0.0) + 0.38 * max(dot(n, vec3(-0.45, 0.65, 0.61)), 0.0) + 0.1 * (1.0 + n.y);
  c *= 0.38 + 0.72 * light;
  float rim = 1.0 - abs(n.z);
  c = mix(c, edge, glass * rim);
  gl_FragColor = vec4(c, mix(1.0, 0.16 + 0.5 * rim * rim, glass));
}`;

function material() {
  return new ShaderMaterial({
    vertexShader: VERTEX, fragmentShader: FRAGMENT, side: DoubleSide, forceSinglePass: false,
    polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
    uniforms: {
      skin: { value: rgb(SKIN) }, stops: { value: SCALES.signed.flatMap(rgb) }, range: { value: [0, 1] },
      coloured: { value: 0 }, levels: { value: 0 }, glass: { value: 0 }, edge: { value: rgb(glassEdge()) },
    },
  });
}

/** The least and the greatest of the values that there are, [0, 1] where there are none. */
export function extent(values) {
  let low = Infinity;
  let high = -Infinity;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return low <= high ? [low, high] : [0, 1];
}

/** The faces between one vertex of each cell of a grid: what is drawn of many faces while they turn. */
function lighter(positions, faces) {
  const box = new Box3().setFromArray(positions);
  const size = box.getSize(new Vector3());
  const width = Math.max(size.x, size.y, size.z) / CELLS || 1;
  const first = new Map();
  const standIn = new Uint32Array(positions.length / 3);
  for (let i = 0; i < standIn.length; i += 1) {
    const [x, y, z] = [0, 1, 2].map((axis) => Math.floor((positions[3 * i + axis] - box.min.getComponent(axis)) / width));
    const cell = (x * (CELLS + 1) + y) * (CELLS + 1) + z;
    if (!first.has(cell)) first.set(cell, i);
    standIn[i] = first.get(cell);
  }
  const kept = [];
  for (let i = 0; i < faces.length; i += 3) {
    const [a, b, c] = [standIn[faces[i]], standIn[faces[i + 1]], standIn[faces[i + 2]]];
    if (a !== b && b !== c && c !== a) kept.push(a, b, c);
  }
  return Uint32Array.from(kept);
}

/** A shape in a common frame: turned to be seen well, moved to the middle, its farthest point at distance 1. */
export class Surface {
  /** data: { positions: Float32Array, faces: Uint32Array, offset }: with the offset, positions are in the file's units. */
  constructor(data) {
    this.positions = data.positions;
    this.offset = new Vector3(...data.offset);
    this.geometry = new BufferGeometry();
    this.geometry.setAttribute("position", new BufferAttribute(data.positions, 3));
    this.geometry.setAttribute("value", new BufferAttribute(new Float32Array(data.positions.length / 3), 1));
    this.geometry.setIndex(new BufferAttribute(data.faces, 1));
    this.geometry.computeVertexNormals();
    this.material = material();
    this.body = new Mesh(this.geometry, this.material);
    this.group = new Group();
    this.group.add(this.body);
    this.group.matrixAutoUpdate = false;
    this.place(principalFrame(data.positions, data.faces));
  }

  /** Turn to a frame: rows right, up, towards the viewer. like: a surface that this one must lie upon. */
  place(frame, like = null) {
    this.frame = frame;
    const [r, u, t] = frame;
    const centre = like?.centre ?? this.#middle(new Matrix4().set(...r, 0, ...u, 0, ...t, 0, 0, 0, 0, 1));
    this.centre = centre;
    this.scale = like?.scale ?? 1 / (this.#reach(centre) || 1);
    this.group.matrix.set(...r, 0, ...u, 0, ...t, 0, 0, 0, 0, 1)
      .multiply(new Matrix4().makeScale(this.scale, this.scale, this.scale))
      .multiply(new Matrix4().makeTranslation(-centre.x, -centre.y, -centre.z));
    this.group.matrixWorldNeedsUpdate = true;
  }

  /** The middle of the box around it as it is seen once turned. */
  #middle(turn) {
    const box = new Box3();
    const at = new Vector3();
    for (let i = 0; i < this.positions.length; i += 3) box.expandByPoint(at.fromArray(this.positions, i).applyMatrix4(turn));
    return box.getCenter(at).applyMatrix4(turn.clone().transpose());
  }

  #reach(centre) {
    let farthest = 0;
    const at = new Vector3();
    for (let i = 0; i < this.positions.length; i += 3)
      farthest = Math.max(farthest, at.fromArray(this.positions, i).distanceToSquared(centre));
    return Math.sqrt(farthest);
  }

  /** Colour by a value per vertex (NaN: none there), or not at all; of a signed one, zero is the middle. Tells the range. */
  colour(values, scale = "signed", levels = true) {
    const { uniforms } = this.material;
    uniforms.coloured.value = values ? 1 : 0;
    if (!values) return [0, 1];
    const attribute = this.geometry.getAttribute("value");
    for (let i = 0; i < values.length; i += 1) attribute.array[i] = Number.isFinite(values[i]) ? values[i] : NOTHING;
    attribute.needsUpdate = true;
    const [low, high] = extent(values);
    const most = Math.max(-low, high);
    uniforms.range.value = scale === "signed" ? [-most, most] : [low, high];
    uniforms.stops.value = SCALES[scale].flatMap(rgb);
    uniforms.levels.value = levels ? LEVELS : 0;
    return uniforms.range.value;
  }

  /** With few faces, while it turns where all of them are too slow; or with all. */
  light(on) {
    const faces = this.geometry.index.array;
    if (on && !this.few && faces.length / 3 > MANY_FACES) {
      this.few = new BufferGeometry();
      for (const name of ["position", "value", "normal"]) this.few.setAttribute(name, this.geometry.getAttribute(name));
      this.few.setIndex(new BufferAttribute(lighter(this.positions, faces), 1));
    }
    this.body.geometry = on && this.few ? this.few : this.geometry;
  }

  /** As glass, to see a skeleton inside. */
  glass(on) {
    this.material.uniforms.glass.value = on ? 1 : 0;
    this.material.transparent = on;
    this.material.depthWrite = !on;
    this.material.needsUpdate = true;
  }

  wireframe(on) {
    if (on && !this.wires) {
      this.wires = new Mesh(this.geometry, new MeshBasicMaterial({ wireframe: true, color: 0x1b2733, transparent: true, opacity: 0.3 }));
      this.group.add(this.wires);
    }
    if (this.wires) this.wires.visible = on;
  }

  /** Add the skeleton that the API gives, drawn in the surface's units. ink: colour of its lines. */
  addSkeleton(skeleton, ink) {
    this.bones?.removeFromParent();
    disposeOf(this.bones);
    this.bones = bones(skeleton, this.offset, 1 / this.scale, ink);
    this.group.add(this.bones);
  }

  /** How far it reaches from the middle of the scene, to the right, up and to the viewer. */
  halves() {
    const [reach, at] = [[0, 0, 0], new Vector3()];
    for (let i = 0; i < this.positions.length; i += 3) {
      at.fromArray(this.positions, i).applyMatrix4(this.group.matrix);
      reach.forEach((most, axis) => { reach[axis] = Math.max(most, Math.abs(at.getComponent(axis))); });
    }
    return reach;
  }

  /** Where a point of the file's units is in the scene. */
  at(point) {
    this.group.updateWorldMatrix(true, false);
    return new Vector3(...point).sub(this.offset).applyMatrix4(this.group.matrixWorld);
  }

  dispose() {
    this.light(false);
    this.few?.dispose();
    this.group.removeFromParent();
    disposeOf(this.group);
  }
}

function disposeOf(root) {
  root?.traverse((thing) => {
    thing.geometry?.dispose();
    thing.material?.dispose();
    if (thing.isInstancedMesh) thing.dispose();
  });
}

/** Edges as rods, nodes as joints, endpoints as coloured balls. */
function bones(skeleton, offset, radius, ink) {
  const made = new Group();
  const places = skeleton.nodes.map((node) => new Vector3(...node.position).sub(offset));
  const paint = new MeshBasicMaterial({ color: ink });
  const rods = new InstancedMesh(new CylinderGeometry(1, 1, 1, 8, 1, true), paint, Math.max(1, skeleton.edges.length));
  rods.count = skeleton.edges.length;
  const [up, middle, along] = [new Vector3(0, 1, 0), new Vector3(), new Vector3()];
  const thickness = 0.0065 * radius;
  skeleton.edges.forEach(({ nodes: [a, b] }, i) => {
    along.subVectors(places[b], places[a]);
    const length = along.length();
    const turn = new Quaternion().setFromUnitVectors(up, length > 0 ? along.divideScalar(length) : up);
    middle.addVectors(places[a], places[b]).multiplyScalar(0.5);
    rods.setMatrixAt(i, new Matrix4().compose(middle, turn, new Vector3(thickness, length, thickness)));
  });
  const ball = new SphereGeometry(1, 16, 12);
  const joints = new InstancedMesh(ball, paint, Math.max(1, places.length));
  joints.count = places.length;
  places.forEach((place, i) => joints.setMatrixAt(i, new Matrix4().compose(place, new Quaternion(),
    new Vector3().setScalar(1.25 * thickness))));
  for (const one of [rods, joints]) one.frustumCulled = false;
  made.add(rods, joints);
  return made;
}

