/** A working volume about the rotation axis, drawn over the surface, and what its handles change. */
import type { Vec } from "./camera";

/** mm: radius about z, lowest and largest height. */
export interface Cylinder {
  radius: number;
  bottom: number;
  top: number;
}

export type CylinderPart = keyof Cylinder;
export const CYLINDER_PARTS: readonly CylinderPart[] = ["radius", "bottom", "top"];
/** mm that a cylinder is high and wide, at least: it is never inside out. */
const LEAST = 0.5;
const SIDES = 48;

/** A point of a circle of the cylinder. */
export function rim(of: Cylinder, height: number, angle: number): Vec {
  return [of.radius * Math.cos(angle), of.radius * Math.sin(angle), height];
}

/** A closed circle of the cylinder. */
export function circle(of: Cylinder, height: number): Vec[] {
  return Array.from({ length: SIDES }, (_, i) => rim(of, height, (2 * Math.PI * i) / SIDES));
}

/** Where a handle is, and which way it moves; `azimuth` is that of the eye. */
export function handleOf(of: Cylinder, part: CylinderPart, azimuth: number): { at: Vec; way: Vec } {
  if (part !== "radius") return { at: [0, 0, of[part]], way: [0, 0, 1] };
  // To the right of the eye: there a radius is seen at its full length.
  const side = azimuth + Math.PI / 2;
  return { at: rim(of, (of.bottom + of.top) / 2, side), way: [Math.cos(side), Math.sin(side), 0] };
}

/** The cylinder with one of its sizes changed, as far as it stays one. */
export function resized(of: Cylinder, part: CylinderPart, to: number): Cylinder {
  if (part === "radius") return { ...of, radius: Math.max(to, LEAST) };
  if (part === "bottom") return { ...of, bottom: Math.min(to, of.top - LEAST) };
  return { ...of, top: Math.max(to, of.bottom + LEAST) };
}
