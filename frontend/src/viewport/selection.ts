/** What is selected, one byte a face. */
import type { AnyArray } from "../envelope";
import type { MeshModel } from "../mesh/model";

export type Mode = "replace" | "add" | "remove" | "intersect";

export class Selection {
  faces = new Uint8Array(0);
  count = 0;
  /** Counts every change. */
  version = 0;

  /** Room for the faces of a mesh; faces that died or were taken back are no longer selected. */
  follow(mesh: MeshModel): void {
    const next = new Uint8Array(mesh.faceCount);
    if (this.count === 0) {
      this.faces = next;
      return;
    }
    next.set(this.faces.subarray(0, mesh.faceCount));
    for (let face = 0; face < mesh.faceCount; face++) next[face] &= mesh.alive[face];
    this.set(next);
  }

  set(faces: Uint8Array<ArrayBuffer>): void {
    this.faces = faces;
    this.count = faces.reduce((sum, one) => sum + one, 0);
    this.version += 1;
  }

  clear(): void {
    this.set(new Uint8Array(this.faces.length));
  }

  combine(picked: Iterable<number>, mode: Mode): void {
    const next = mode === "replace" || mode === "intersect" ? new Uint8Array(this.faces.length) : this.faces;
    for (const face of picked) {
      if (mode === "intersect") next[face] = this.faces[face];
      else next[face] = mode === "remove" ? 0 : 1;
    }
    this.set(next);
  }

  invert(mesh: MeshModel): void {
    this.set(this.faces.map((one, face) => (one ? 0 : mesh.alive[face])));
  }

  /** The selection as arrays of a request: a list of numbers, or a bit for each face where that is shorter. */
  arrays(): Record<string, AnyArray> {
    const bytes = Math.ceil(this.faces.length / 8);
    if (4 * this.count <= bytes) return { faces: this.numbers() };
    const bits = new Uint8Array(bytes);
    for (let face = 0; face < this.faces.length; face++) bits[face >> 3] |= this.faces[face] << (face & 7);
    return { face_bits: bits };
  }

  numbers(): Uint32Array<ArrayBuffer> {
    const out = new Uint32Array(this.count);
    let n = 0;
    for (let face = 0; n < out.length; face++) if (this.faces[face]) out[n++] = face;
    return out;
  }
}

/** The mode that the keys held down ask for: Shift adds, Ctrl or Alt removes, both intersect. */
export function modeOf(event: { shiftKey: boolean; ctrlKey: boolean; altKey: boolean }): Mode {
  const remove = event.ctrlKey || event.altKey;
  if (event.shiftKey) return remove ? "intersect" : "add";
  return remove ? "remove" : "replace";
}

/** All set bytes of a mask as face numbers. */
export function* marked(mask: Uint8Array): Generator<number> {
  for (let face = 0; face < mask.length; face++) if (mask[face]) yield face;
}
