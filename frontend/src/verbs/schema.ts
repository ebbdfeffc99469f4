/** Schemas of verbs, as the server hands them out, and the values that are put into their forms. */
import type { FileEntry, RemedyOption } from "../protocol";

type Kind = "string" | "number" | "integer" | "boolean" | "array" | "null";

/** What the form needs of JSON Schema, and what turnscan adds to it. */
export interface Property {
  type: Kind | Kind[];
  role: "option" | "input" | "output";
  description: string;
  enum?: (string | null)[];
  items?: Omit<Property, "role" | "description">;
  minimum?: number;
  exclusiveMinimum?: number;
  maximum?: number;
  default?: unknown;
  unit?: string;
  group?: string;
  /** Kinds of files that an input takes. */
  accepts?: string[];
}

export interface Schema {
  title: string;
  description: string;
  properties: Record<string, Property>;
  required: string[];
}

export type Values = Readonly<Record<string, unknown>>;

export function labelOf(name: string): string {
  const words = name.replace(/_deg$/, "").replaceAll("_", " ");
  return words[0].toUpperCase() + words.slice(1);
}

export const isMany = (property: Property) => property.type === "array";

function kindOf(property: Property): Kind {
  const type = property.items?.type ?? property.type;
  return Array.isArray(type) ? type.filter((one) => one !== "null")[0] : type;
}

/** How a value is put in: by a list, a tick, a number or a text. */
export function fieldOf(property: Property): "files" | "suffixes" | "choices" | "choice" | "tick" | "number" | "text" {
  if (property.role === "input") return "files";
  if (property.role === "output") return "suffixes";
  if (property.items?.enum) return "choices";
  if (property.enum) return "choice";
  const kind = kindOf(property);
  if (kind === "boolean") return "tick";
  return !isMany(property) && kind !== "string" ? "number" : "text";
}

export function startValues(schema: Schema): Values {
  return Object.fromEntries(
    Object.entries(schema.properties).map(([name, property]) => [
      name,
      property.default ?? (isMany(property) ? [] : property.role === "input" ? "" : null),
    ]),
  );
}

/** A value as it is written in a text field; several are parted by semicolons. */
export function toText(value: unknown): string {
  if (value === null || value === undefined) return "";
  return Array.isArray(value) ? value.join("; ") : String(value);
}

/** The value that a text stands for: null where it is empty, a text where it is no number. */
export function fromText(property: Property, text: string): unknown {
  const one = (part: string): unknown => {
    const number = Number(part);
    return kindOf(property) === "string" || part === "" || Number.isNaN(number) ? part : number;
  };
  if (isMany(property))
    return text
      .split(";")
      .map((part) => part.trim())
      .filter(Boolean)
      .map(one);
  if (kindOf(property) === "boolean") return text === "true";
  return text.trim() === "" ? null : one(text.trim());
}

/** What is wrong with a value, for the field; null where nothing is. */
export function trouble(property: Property, required: boolean, value: unknown): string | null {
  const missing = value === null || value === "" || (Array.isArray(value) && !value.length);
  if (missing) {
    if (!required) return null;
    if (property.role === "input") return "Choose or drop a file.";
    return property.role === "output" ? "Choose one or more." : "This is needed.";
  }
  for (const one of Array.isArray(value) ? value : [value]) {
    const said = troubleOfOne({ ...property, ...property.items }, one);
    if (said) return said;
  }
  return null;
}

function troubleOfOne(limits: Omit<Property, "role">, value: unknown): string | null {
  const kinds = Array.isArray(limits.type) ? limits.type : [limits.type];
  if (!kinds.includes("number") && !kinds.includes("integer")) return null;
  if (typeof value !== "number") return `“${value}” is not a number.`;
  if (kinds.includes("integer") && !Number.isInteger(value)) return `${value} is not a whole number.`;
  const { minimum, exclusiveMinimum, maximum } = limits;
  if (minimum !== undefined && value < minimum) return `At least ${minimum}.`;
  if (exclusiveMinimum !== undefined && value <= exclusiveMinimum) return `More than ${exclusiveMinimum}.`;
  if (maximum !== undefined && value > maximum) return `At most ${maximum}.`;
  return null;
}

/** Every field with a mistake in it. */
export function troubles(schema: Schema, values: Values): Record<string, string> {
  return Object.fromEntries(
    Object.entries(schema.properties).flatMap(([name, property]) => {
      const said = trouble(property, schema.required.includes(name), values[name]);
      return said ? [[name, said]] : [];
    }),
  );
}

/** What is sent: that which is not at its default. */
export function chosen(schema: Schema, values: Values): Record<string, unknown> {
  const start = startValues(schema);
  return Object.fromEntries(
    Object.entries(values).filter(([name, value]) => JSON.stringify(value) !== JSON.stringify(start[name])),
  );
}

/** The values with what a remedy proposes put in; the same where it proposes none of this verb. */
export function filledIn(schema: Schema, values: Values, option: RemedyOption): Values {
  const property = schema.properties[option.name];
  if (!property || option.value === null) return values;
  return { ...values, [option.name]: fromText(property, option.value) };
}

export function takes(property: Property, kinds: readonly string[]): boolean {
  return kinds.some((kind) => property.accepts?.includes(kind));
}

/** The values with a file put into the first input that takes it and is empty, or else has several. */
export function withFile(schema: Schema, values: Values, file: string, kinds: readonly string[]): Values {
  const inputs = Object.entries(schema.properties).filter(([, property]) => takes(property, kinds));
  for (const [name, property] of inputs) {
    const value = values[name];
    if (isMany(property)) {
      const files = value as string[];
      return files.includes(file) ? values : { ...values, [name]: [...files, file] };
    }
    if (!value) return { ...values, [name]: file };
  }
  return values;
}

const WORDS: Record<string, string> = {
  scan: "a scan",
  mesh: "a mesh",
  pictures: "pictures",
  "range-scan": "a range scan",
  placement: "a placement of range scans",
  rig: "a rig",
  table: "a table of values",
  artefact: "an artefact",
};

/** What a file is, in words. */
export function whatIs({ kinds, pictures }: Pick<FileEntry, "kinds" | "pictures">): string {
  if (pictures) return `${pictures} ${pictures === 1 ? "picture" : "pictures"}`;
  return kinds.map((kind) => WORDS[kind] ?? kind).join(" or ") || "a result";
}
