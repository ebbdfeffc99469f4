import { describe, expect, test } from "vitest";
import {
  chosen,
  fieldOf,
  filledIn,
  fromText,
  labelOf,
  type Property,
  type Schema,
  startValues,
  toText,
  trouble,
  troubles,
  whatIs,
  withFile,
} from "../src/verbs/schema";

const option = (rest: Partial<Property>): Property => ({ type: "number", role: "option", description: "d", ...rest });

const SCHEMA: Schema = {
  title: "Compare",
  description: "d",
  required: ["measured", "reference", "outputs"],
  properties: {
    measured: { type: "string", role: "input", description: "d", accepts: ["mesh", "scan"] },
    reference: { type: "string", role: "input", description: "d", accepts: ["mesh", "scan"] },
    dark: { type: "array", role: "input", description: "d", accepts: ["pictures"] },
    tolerances: option({ type: "array", items: { type: "number", exclusiveMinimum: 0 }, default: [0.05, 0.1] }),
    samples: option({ type: "integer", minimum: 100, maximum: 2000, default: 500 }),
    limit: option({ type: ["number", "null"], exclusiveMinimum: 0, default: null, unit: "mm" }),
    unit: option({ type: "string", enum: ["mm", "inch"], default: "mm" }),
    planes: option({ type: "boolean", default: false }),
    outputs: {
      type: "array",
      role: "output",
      description: "d",
      items: { type: "string", enum: [".stl"] },
      default: [],
    },
  },
};

describe("the form of a verb", () => {
  test("each property has its field", () => {
    const kinds = Object.entries(SCHEMA.properties).map(([name, property]) => [name, fieldOf(property)]);
    expect(Object.fromEntries(kinds)).toEqual({
      measured: "files",
      reference: "files",
      dark: "files",
      tolerances: "text",
      samples: "number",
      limit: "number",
      unit: "choice",
      planes: "tick",
      outputs: "suffixes",
    });
    expect(labelOf("half_plane_deg")).toBe("Half plane");
  });

  test("text becomes a value, and a value text", () => {
    const { limit, tolerances, unit } = SCHEMA.properties;
    expect(fromText(limit, " 0.25 ")).toBe(0.25);
    expect(fromText(limit, "")).toBeNull();
    expect(fromText(limit, "wide")).toBe("wide");
    expect(fromText(tolerances, "0.1; 0.2;")).toEqual([0.1, 0.2]);
    expect(fromText(unit, "12")).toBe("12");
    expect(toText([0.1, 0.2])).toBe("0.1; 0.2");
    expect(toText(null)).toBe("");
  });

  test("mistakes are said at their fields", () => {
    const { limit, samples, tolerances } = SCHEMA.properties;
    expect(trouble(limit, false, null)).toBeNull();
    expect(trouble(limit, false, 0)).toBe("More than 0.");
    expect(trouble(limit, false, "wide")).toBe("“wide” is not a number.");
    expect(trouble(samples, false, 99)).toBe("At least 100.");
    expect(trouble(samples, false, 2001)).toBe("At most 2000.");
    expect(trouble(samples, false, 150.5)).toBe("150.5 is not a whole number.");
    expect(trouble(tolerances, false, [0.1, -1])).toBe("More than 0.");
    expect(troubles(SCHEMA, startValues(SCHEMA))).toEqual({
      measured: "Choose or drop a file.",
      reference: "Choose or drop a file.",
      outputs: "Choose one or more.",
    });
  });

  test("what is at its default is not sent", () => {
    const values = { ...startValues(SCHEMA), measured: "abcd", samples: 100, tolerances: [0.05, 0.1] };
    expect(chosen(SCHEMA, values)).toEqual({ measured: "abcd", samples: 100 });
  });

  test("a file goes into the first input that is empty, pictures where there may be several", () => {
    const first = withFile(SCHEMA, startValues(SCHEMA), "abcd", ["mesh"]);
    expect(first.measured).toBe("abcd");
    const both = withFile(SCHEMA, first, "efgh", ["scan"]);
    expect([both.measured, both.reference]).toEqual(["abcd", "efgh"]);
    expect(withFile(SCHEMA, both, "ijkl", ["mesh"])).toEqual(both);
    const dark = withFile(SCHEMA, withFile(SCHEMA, both, "p1", ["pictures"]), "p2", ["pictures"]);
    expect(withFile(SCHEMA, dark, "p2", ["pictures"]).dark).toEqual(["p1", "p2"]);
    expect(withFile(SCHEMA, both, "rig", ["rig"])).toEqual(both);
  });

  test("a remedy fills its field, where the verb has it and a value is meant", () => {
    const start = startValues(SCHEMA);
    expect(filledIn(SCHEMA, start, { name: "limit", value: "0.5" }).limit).toBe(0.5);
    expect(filledIn(SCHEMA, start, { name: "planes", value: "true" }).planes).toBe(true);
    expect(filledIn(SCHEMA, start, { name: "limit", value: null })).toBe(start);
    expect(filledIn(SCHEMA, start, { name: "unheard", value: "1" })).toBe(start);
  });

  test("files are named in words", () => {
    expect(whatIs({ kinds: ["pictures"], pictures: 24 })).toBe("24 pictures");
    expect(whatIs({ kinds: ["table", "artefact"], pictures: 0 })).toBe("a table of values or an artefact");
    expect(whatIs({ kinds: [], pictures: 0 })).toBe("a result");
  });
});
