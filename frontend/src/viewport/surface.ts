/** The mesh on the graphics card: one set of vertices, an index for each thing drawn of it. */
import {
  BufferAttribute,
  BufferGeometry,
  DynamicDrawUsage,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  Scene,
  type ShaderMaterial,
  Vector4,
} from "three";
import type { MeshModel } from "../mesh/model";
import { putNormals, vertexNormals } from "../mesh/normals";
import { standIn } from "../mesh/standin";
import { borderEdges, bordersAfter, markVertices } from "../mesh/topology";
import { surfaceMaterial } from "./shaders";

export interface CutPlane {
  normal: [number, number, number];
  /** mm from the origin along the normal; what lies below goes. */
  offset: number;
}

const NO_PLANE = new Vector4(0, 0, 0, -1);

export class Surface {
  readonly base = new Scene();
  readonly overlay = new Scene();
  readonly coarse = new Scene();
  private readonly full = new Mesh(new BufferGeometry(), surfaceMaterial());
  private readonly quick = new Mesh(new BufferGeometry(), surfaceMaterial());
  private readonly unmeasured = layer({ tint: [0.48, 0.52, 0.84], offset: -1 });
  private readonly selected = layer({ tint: [0.94, 0.41, 0.12], offset: -2 });
  private readonly borders = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ color: 0xffc24a }));
  private readonly preview = layer({ tint: [0.25, 0.72, 0.95], opacity: 0.65, offset: -3 });
  private readonly doomed = layer({ tint: [0.85, 0.3, 0.2], offset: -2 });
  private mesh: MeshModel | null = null;
  private coarseVersion = -1;
  private borderVersion = -1;
  private edges: Uint32Array = new Uint32Array(0);

  constructor() {
    this.base.add(this.full, this.unmeasured, this.borders);
    this.coarse.add(this.quick);
    this.overlay.add(this.selected, this.doomed, this.preview);
    for (const scene of [this.base, this.overlay, this.coarse]) {
      scene.traverse((thing) => {
        thing.frustumCulled = false;
        thing.matrixAutoUpdate = false;
      });
    }
  }

  setMesh(mesh: MeshModel | null): void {
    this.mesh = mesh;
    this.coarseVersion = this.borderVersion = -1;
    this.showPreview(null);
    this.vertices();
  }

  /** All vertex buffers and the index anew: another mesh, or more vertices. */
  vertices(): void {
    const { mesh } = this;
    const position = new BufferAttribute(
      mesh ? mesh.positions.subarray(0, 3 * mesh.vertexCount) : new Float32Array(0),
      3,
    );
    const normal = new BufferAttribute(mesh ? vertexNormals(mesh) : new Int8Array(0), 4, true);
    const tint = new BufferAttribute(new Uint8Array(mesh ? 4 * mesh.vertexCount : 0), 4, true);
    for (const thing of [this.full, this.quick, this.unmeasured, this.selected, this.borders, this.doomed]) {
      thing.geometry.dispose();
      thing.geometry = new BufferGeometry();
      thing.geometry.setAttribute("position", position);
      thing.geometry.setAttribute("normal", normal);
      thing.geometry.setAttribute("tint", tint);
      setIndex(thing.geometry, new Uint32Array(0));
    }
    this.faces();
  }

  /** The index anew, from what is alive. */
  faces(): void {
    const { mesh } = this;
    if (!mesh) return;
    const index = mesh.faces.slice(0, 3 * mesh.faceCount);
    const gaps: number[] = [];
    for (let face = 0; face < mesh.faceCount; face++) {
      if (!mesh.alive[face]) index.fill(0, 3 * face, 3 * face + 3);
      else if (!mesh.measured[face]) gaps.push(face);
    }
    setIndex(this.full.geometry, index);
    setIndex(this.unmeasured.geometry, corners(mesh, gaps));
  }

  /** Only these faces have died or come back: normals and borders elsewhere are what they were. */
  touched(parts: readonly Uint32Array[]): void {
    const { mesh } = this;
    if (!mesh) return;
    const marks = new Uint8Array(mesh.vertexCount);
    for (const numbers of parts) {
      this.reindex(mesh, numbers);
      markVertices(mesh, numbers, marks);
    }
    const normal = this.full.geometry.getAttribute("normal") as BufferAttribute;
    putNormals(mesh, normal.array as Int8Array, marks);
    normal.needsUpdate = true;
    // Every part has made the mesh one version newer.
    if (this.borderVersion === mesh.version - parts.length) this.putBorders(bordersAfter(mesh, this.edges, marks));
  }

  /** The rest of the index stays on the card. */
  private reindex(mesh: MeshModel, numbers: Uint32Array): void {
    const index = this.full.geometry.index;
    if (!index) return;
    const array = index.array as Uint32Array;
    let low = Infinity;
    let high = -1;
    for (const face of numbers) {
      const at = 3 * face;
      if (mesh.alive[face]) array.set(mesh.faces.subarray(at, at + 3), at);
      else array.fill(0, at, at + 3);
      low = Math.min(low, at);
      high = Math.max(high, at);
    }
    if (high < 0) return;
    index.addUpdateRange(low, high + 3 - low);
    index.needsUpdate = true;
  }

  tint(rgba: Uint8Array): void {
    const tint = this.full.geometry.getAttribute("tint") as BufferAttribute;
    (tint.array as Uint8Array).set(rgba);
    tint.needsUpdate = true;
  }

  showUnmeasured(on: boolean): void {
    this.unmeasured.visible = on;
  }

  showBorders(on: boolean): void {
    this.borders.visible = on;
    if (!on || !this.mesh || this.borderVersion === this.mesh.version) return;
    this.putBorders(borderEdges(this.mesh));
  }

  private putBorders(edges: Uint32Array): void {
    this.edges = edges;
    setIndex(this.borders.geometry, edges);
    this.borderVersion = this.mesh?.version ?? -1;
  }

  select(faces: Uint32Array): void {
    setIndex(this.selected.geometry, this.mesh ? corners(this.mesh, faces) : new Uint32Array(0));
  }

  /** What an edit would add, and what it would take away. */
  showPreview(change: { positions: Float32Array; faces: Uint32Array; dead: Uint32Array } | null): void {
    this.preview.geometry.dispose();
    this.preview.geometry = new BufferGeometry();
    this.preview.visible = this.doomed.visible = change !== null;
    if (!change || !this.mesh) return;
    this.preview.geometry.setAttribute("position", new BufferAttribute(change.positions, 3));
    this.preview.geometry.setAttribute(
      "tint",
      new BufferAttribute(new Uint8Array((change.positions.length / 3) * 4), 4, true),
    );
    setIndex(this.preview.geometry, change.faces);
    this.preview.geometry.computeVertexNormals();
    setIndex(this.doomed.geometry, corners(this.mesh, change.dead));
  }

  setPlane(plane: CutPlane | null): void {
    const value = plane ? new Vector4(...plane.normal, plane.offset) : NO_PLANE;
    for (const thing of [this.full, this.quick]) (thing.material as ShaderMaterial).uniforms.plane.value = value;
  }

  /** The coarse mesh, of about so many faces, is made anew after an edit, when it is first needed. */
  prepareCoarse(faces: number): void {
    if (!this.mesh || this.coarseVersion === this.mesh.version) return;
    setIndex(this.quick.geometry, standIn(this.mesh, faces).index);
    this.coarseVersion = this.mesh.version;
  }
}

function layer(look: Parameters<typeof surfaceMaterial>[0]): Mesh {
  return new Mesh(new BufferGeometry(), surfaceMaterial(look));
}

/** Put another index in place, in the same buffer while it is large enough: a brush does it often. */
function setIndex(geometry: BufferGeometry, index: Uint32Array): void {
  geometry.setDrawRange(0, index.length);
  const old = geometry.index;
  if (old && old.array.length >= index.length) {
    (old.array as Uint32Array).set(index);
    old.clearUpdateRanges();
    old.addUpdateRange(0, index.length);
    old.needsUpdate = true;
    return;
  }
  const room = old ? new Uint32Array(Math.max(index.length, 2 * old.array.length)) : index;
  if (old) room.set(index);
  const attribute = new BufferAttribute(room, 1);
  attribute.setUsage(DynamicDrawUsage);
  geometry.setIndex(attribute);
}

function corners(mesh: MeshModel, faces: ArrayLike<number>): Uint32Array {
  const out = new Uint32Array(3 * faces.length);
  for (let i = 0; i < faces.length; i++) {
    const at = 3 * faces[i];
    out[3 * i] = mesh.faces[at];
    out[3 * i + 1] = mesh.faces[at + 1];
    out[3 * i + 2] = mesh.faces[at + 2];
  }
  return out;
}
