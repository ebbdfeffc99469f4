import { describe, expect, it } from "vitest";
import { Selection } from "../src/viewport/selection";

const of = (mask: number[]) => {
  const selection = new Selection();
  selection.set(Uint8Array.from(mask));
  return selection;
};

describe("a selection on its way to the server", () => {
  it("is a list of numbers while that is short", () => {
    const mask = new Array(400).fill(0);
    mask[7] = mask[399] = 1;
    expect(of(mask).arrays()).toEqual({ faces: Uint32Array.of(7, 399) });
  });

  it("is a bit for each face where that is shorter, the first face in the lowest bit", () => {
    expect(of([1, 0, 0, 1, 1, 1, 1, 1, 0, 1]).arrays()).toEqual({ face_bits: Uint8Array.of(0b11111001, 0b10) });
  });

  it("of a whole surface of a million faces fits into a message", () => {
    const whole = of(new Array(1_000_000).fill(1)).arrays();
    expect(whole.face_bits?.byteLength).toBe(125_000);
  });
});
