import { describe, expect, it } from "vitest";
import { colourVertices } from "../src/mesh/colours";
import { MeshModel } from "../src/mesh/model";
import { putNormals, vertexNormals } from "../src/mesh/normals";
import { standIn } from "../src/mesh/standin";
import { borderEdges, bordersAfter, markVertices, Topology } from "../src/mesh/topology";
import { ViewCamera } from "../src/viewport/camera";
import { pick } from "../src/viewport/pick";
import { fillOutline, Projection } from "../src/viewport/region";
import { Selection } from "../src/viewport/selection";
import { plate, tube } from "./shapes";

function kill(mesh: MeshModel, faces: Uint32Array): void {
  mesh.apply({ kind: "alive", faces, value: false });
}

describe("MeshModel", () => {
  it("deletes and brings back by number, and appends behind", () => {
    const mesh = new MeshModel(plate(4));
    expect(mesh.aliveCount).toBe(32);
    kill(mesh, Uint32Array.of(3, 4, 4));
    expect(mesh.aliveCount).toBe(30);
    mesh.apply({
      kind: "append",
      positions: Float32Array.of(9, 9, 9),
      faces: Uint32Array.of(0, 1, 25),
      measured: Uint8Array.of(0),
      sigma: Float32Array.of(NaN),
      laser: Int32Array.of(-1),
      step: Int32Array.of(-1),
      line: Int32Array.of(-1),
    });
    expect([mesh.vertexCount, mesh.faceCount, mesh.aliveCount]).toEqual([26, 33, 31]);
    expect([...mesh.positions.subarray(75, 78)]).toEqual([9, 9, 9]);
    mesh.apply({ kind: "verts", ids: Uint32Array.of(25), positions: Float32Array.of(1, 1, 5) });
    expect(mesh.bounds()?.high[2]).toBe(5);
    mesh.apply({ kind: "truncate", vertices: 25, faces: 32 });
    mesh.apply({ kind: "alive", faces: Uint32Array.of(3, 4), value: true });
    expect(mesh.aliveCount).toBe(32);
    expect(mesh.bounds()).toEqual({ low: [0, 0, 0], high: [4, 4, 0] });
  });

  it("has normals that point out, and none of dead faces", () => {
    const mesh = new MeshModel(tube(24, 4));
    const normals = vertexNormals(mesh);
    for (let v = 0; v < mesh.vertexCount; v++) {
      const out = normals[4 * v] * mesh.positions[3 * v] + normals[4 * v + 1] * mesh.positions[3 * v + 1];
      expect(out).toBeGreaterThan(0.95 * 127 * 10);
    }
  });
});

describe("what a few faces change", () => {
  it("is found about them alone, and is what all of it anew would be", () => {
    const mesh = new MeshModel(tube(24, 6));
    const normals = vertexNormals(mesh);
    let edges = borderEdges(mesh);
    const sorted = (of: Uint32Array) =>
      Array.from({ length: of.length / 2 }, (_, i) => `${of[2 * i]} ${of[2 * i + 1]}`).sort();
    for (const [value, ...faces] of [
      [0, 10, 11, 12, 60],
      [0, 13, 61, 200],
      [1, 11, 12, 60, 61],
      [1, 10, 13, 200],
    ]) {
      const numbers = Uint32Array.from(faces);
      mesh.apply({ kind: "alive", faces: numbers, value: value === 1 });
      const marks = new Uint8Array(mesh.vertexCount);
      markVertices(mesh, numbers, marks);
      putNormals(mesh, normals, marks);
      edges = bordersAfter(mesh, edges, marks);
      expect(normals).toEqual(vertexNormals(mesh));
      expect(sorted(edges)).toEqual(sorted(borderEdges(mesh)));
    }
    expect(edges.length).toBe(2 * 2 * 24);
  });

  it("is seen in the box about the faces that are there", () => {
    const mesh = new MeshModel(plate(4));
    const before = mesh.bounds();
    kill(
      mesh,
      Uint32Array.from({ length: 8 }, (_, face) => face),
    );
    expect(mesh.bounds()).not.toEqual(before);
    mesh.apply({ kind: "alive", faces: Uint32Array.from({ length: 8 }, (_, face) => face), value: true });
    expect(mesh.bounds()).toEqual(before);
  });
});

describe("Topology", () => {
  it("grows, shrinks and floods", () => {
    const mesh = new MeshModel(plate(9));
    const topology = new Topology(mesh);
    const seed = new Uint8Array(mesh.faceCount);
    seed[2 * (9 * 4 + 4)] = 1;
    const grown = topology.grow(seed);
    expect(grown.reduce((a, b) => a + b)).toBe(13);
    expect(topology.shrink(topology.grow(grown)).every((one, i) => one >= grown[i])).toBe(true);
    expect(topology.connected([0]).every((one) => one === 1)).toBe(true);
  });

  it("stops at what is dead and at a crease", () => {
    const mesh = new MeshModel(plate(9));
    const column = Array.from({ length: 9 }, (_, row) => [2 * (9 * row + 4), 2 * (9 * row + 4) + 1]).flat();
    kill(mesh, Uint32Array.from(column));
    expect(new Topology(mesh).connected([0]).reduce((a, b) => a + b)).toBe(72);
    const bent = new MeshModel(plate(10, (x) => (x > 5 ? x - 5 : 0)));
    const flat = new Topology(bent).smooth([0], 0.3);
    expect(flat.reduce((a, b) => a + b)).toBe(100);
    expect(new Topology(bent).smooth([0], 1).every((one) => one === 1)).toBe(true);
  });

  it("finds the borders", () => {
    const mesh = new MeshModel(plate(5));
    expect(borderEdges(mesh).length / 2).toBe(20);
    kill(mesh, Uint32Array.of(24, 25));
    expect(borderEdges(mesh).length / 2).toBe(24);
    expect(borderEdges(new MeshModel(tube(24, 4))).length / 2).toBe(48);
  });
});

describe("stand-in", () => {
  it("has about the faces wanted, and nothing that was deleted", () => {
    const mesh = new MeshModel(tube(400, 300));
    const coarse = standIn(mesh, 4000);
    expect(coarse.faces).toBeGreaterThan(1500);
    expect(coarse.faces).toBeLessThan(12000);
    const upper = Uint32Array.from({ length: mesh.faceCount }, (_, i) => i).filter(
      (face) => mesh.positions[3 * mesh.faces[3 * face] + 2] > 30,
    );
    kill(mesh, upper);
    for (const v of standIn(mesh, 4000).index) expect(mesh.positions[3 * v + 2]).toBeLessThanOrEqual(31);
  });
});

describe("colours", () => {
  it("shows what is known of regions, and gives one colour to what is all alike", () => {
    const mesh = new MeshModel(plate(20));
    for (let v = 0; v < mesh.vertexCount; v++) mesh.sigma[v] = 0.01 + 0.02 * (v % 2);
    mesh.quality = new Float32Array(mesh.vertexCount).fill(0.02);
    const { rgba, legend } = colourVertices(mesh, "sigma");
    expect(legend?.low).toBeCloseTo(0.02 / 1.4);
    expect(legend?.high).toBeCloseTo(0.028);
    expect(rgba.slice(0, 3)).toEqual(rgba.slice(4, 7));
    mesh.quality[1] = 0.028;
    expect(colourVertices(mesh, "sigma").rgba.slice(4, 7)).not.toEqual(rgba.slice(4, 7));
  });

  it("maps sigma over its spread and names its ends", () => {
    const mesh = new MeshModel(plate(20));
    for (let v = 0; v < mesh.vertexCount; v++) mesh.sigma[v] = v / mesh.vertexCount;
    const { rgba, legend } = colourVertices(mesh, "sigma");
    expect(legend?.low).toBeCloseTo(0.02, 1);
    expect(legend?.high).toBeCloseTo(0.98, 1);
    expect([...rgba.subarray(0, 3)]).toEqual([0, 34, 78]);
    expect([...rgba.subarray(-4, -1)]).toEqual([254, 232, 56]);
  });
});

describe("camera", () => {
  const camera = new ViewCamera();
  camera.resize(800, 600);
  for (const orthographic of [false, true]) {
    it(`projects and casts rays alike (${orthographic ? "orthographic" : "perspective"})`, () => {
      camera.orthographic = orthographic;
      camera.azimuth = 0.7;
      camera.elevation = 0.4;
      const at = new Float64Array(3);
      camera.projector()(12, -7, 55, at);
      const ray = camera.ray(at[0], at[1]);
      const to = [12, -7, 55].map((x, i) => x - ray.origin[i]);
      const t = to.reduce((sum, x, i) => sum + x * ray.direction[i], 0);
      for (const [i, x] of to.entries()) expect(x - t * ray.direction[i]).toBeCloseTo(0, 6);
    });
  }

  it("zooms to the cursor and turns about a point that stays", () => {
    camera.orthographic = false;
    const at = new Float64Array(3);
    const before = camera.ray(500, 200);
    const point = before.origin.map(
      (x, i) => x + (before.direction[i] * camera.distance) / dotWithForward(camera, before.direction),
    );
    camera.zoom(2, 500, 200);
    camera.projector()(point[0], point[1], point[2], at);
    expect(at[0]).toBeCloseTo(500, 3);
    expect(at[1]).toBeCloseTo(200, 3);
    camera.orbit(57, -23, [point[0], point[1], point[2]]);
    camera.projector()(point[0], point[1], point[2], at);
    expect(at[0]).toBeCloseTo(500, 3);
    expect(at[1]).toBeCloseTo(200, 3);
  });
});

function dotWithForward(camera: ViewCamera, d: readonly number[]): number {
  return camera.axes()[2].reduce((sum, x, i) => sum + x * d[i], 0);
}

describe("picking and regions", () => {
  const mesh = new MeshModel(tube(60, 40));
  const camera = new ViewCamera();
  camera.resize(800, 600);
  camera.view("right");
  camera.fit(mesh.bounds()!);
  camera.contain(mesh.bounds()!);

  it("meets the nearer side", () => {
    const hit = pick(mesh, camera.ray(400, 300));
    expect(hit?.point[0]).toBeCloseTo(10, 1);
    expect(pick(mesh, camera.ray(2, 2))).toBeNull();
  });

  it("takes both sides through, and only the near side that is seen", () => {
    const region = fillOutline([
      [300, 200],
      [500, 200],
      [500, 400],
      [300, 400],
    ]);
    const projection = new Projection(mesh, camera);
    const through = projection.inside(region, null);
    const depth = new Float32Array(800 * 600).fill(Infinity);
    for (let face = 0; face < mesh.faceCount; face++) {
      const x = Math.floor(projection.x[face]);
      const row = 599 - Math.floor(projection.y[face]);
      for (let r = row - 8; r <= row + 8; r++) {
        for (let c = x - 8; c <= x + 8; c++) depth[r * 800 + c] = Math.min(depth[r * 800 + c], projection.depth[face]);
      }
    }
    const seen = projection.inside(region, { width: 800, height: 600, ratio: 1, depth });
    expect(seen.length).toBeGreaterThan(0.3 * through.length);
    expect(seen.length).toBeLessThan(0.6 * through.length);
    for (const face of seen) expect(mesh.positions[3 * mesh.faces[3 * face]]).toBeGreaterThan(0);
    // Noise that tilts a face away from the eye hides nothing: what counts is its depth.
    const [a, b] = [3 * seen[0], 3 * seen[0] + 1];
    [mesh.faces[a], mesh.faces[b]] = [mesh.faces[b], mesh.faces[a]];
    expect(projection.looksAtEye(seen[0])).toBe(false);
    expect(projection.inside(region, { width: 800, height: 600, ratio: 1, depth })).toEqual(seen);
    [mesh.faces[a], mesh.faces[b]] = [mesh.faces[b], mesh.faces[a]];
  });

  it("fills an outline that crosses itself by the nonzero rule", () => {
    const star: [number, number][] = Array.from({ length: 5 }, (_, i) => [
      50 + 40 * Math.cos(i * 2.5133),
      50 + 40 * Math.sin(i * 2.5133),
    ]);
    const { mask, x, y, width } = fillOutline(star);
    expect(mask[(50 - y) * width + 50 - x]).toBe(1);
    expect(
      fillOutline([
        [0, 0],
        [10, 0],
        [10, 10],
        [0, 10],
      ]).mask.reduce((a, b) => a + b),
    ).toBe(100);
  });

  it("adds, removes, intersects and inverts", () => {
    const selection = new Selection();
    selection.follow(mesh);
    selection.combine([1, 2, 3], "replace");
    selection.combine([3, 4], "add");
    expect([...selection.numbers()]).toEqual([1, 2, 3, 4]);
    selection.combine([2, 9], "remove");
    selection.combine([1, 3, 7], "intersect");
    expect([...selection.numbers()]).toEqual([1, 3]);
    selection.invert(mesh);
    expect(selection.count).toBe(mesh.aliveCount - 2);
    kill(mesh, Uint32Array.of(0));
    selection.follow(mesh);
    expect(selection.count).toBe(mesh.aliveCount - 2);
  });
});
