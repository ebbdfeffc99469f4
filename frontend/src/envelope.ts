/** A JSON header and arrays in one message; `turnscan/app/_envelope.py` is the other end. */
import type { DType } from "./protocol";

export type AnyArray = Float32Array | Int32Array | Uint32Array | Int16Array | Uint16Array | Uint8Array | Int8Array;

const KINDS = {
  f32: Float32Array,
  i32: Int32Array,
  u32: Uint32Array,
  i16: Int16Array,
  u16: Uint16Array,
  u8: Uint8Array,
  i8: Int8Array,
} satisfies Record<DType, unknown>;

interface Described {
  name: string;
  dtype: DType;
  shape: number[];
}

export class Arrays {
  constructor(private readonly items: Map<string, { array: AnyArray; shape: number[] }>) {}

  has(name: string): boolean {
    return this.items.has(name);
  }

  shape(name: string): number[] {
    return this.item(name).shape;
  }

  f32 = (name: string) => this.typed(name, Float32Array);
  i32 = (name: string) => this.typed(name, Int32Array);
  u32 = (name: string) => this.typed(name, Uint32Array);
  u16 = (name: string) => this.typed(name, Uint16Array);
  u8 = (name: string) => this.typed(name, Uint8Array);
  i8 = (name: string) => this.typed(name, Int8Array);

  names(): string[] {
    return [...this.items.keys()];
  }

  private item(name: string): { array: AnyArray; shape: number[] } {
    const item = this.items.get(name);
    if (!item) throw new Error(`message without the array ${name}`);
    return item;
  }

  private typed<T extends AnyArray>(name: string, kind: abstract new (...args: never[]) => T): T {
    const { array } = this.item(name);
    if (!(array instanceof kind)) throw new Error(`the array ${name} is of another type`);
    return array;
  }
}

export interface Message<H> {
  header: H;
  arrays: Arrays;
}

export const NO_ARRAYS = new Arrays(new Map());

/** Take a message apart; the arrays are views of its buffer. */
export function unpack<H>(buffer: ArrayBuffer): Message<H> {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const items = new Map<string, { array: AnyArray; shape: number[] }>();
  let place = 4 + length;
  for (const { name, dtype, shape } of (header.arrays ?? []) as Described[]) {
    place = Math.ceil(place / 8) * 8;
    const count = shape.reduce((product, n) => product * n, 1);
    const array = new KINDS[dtype](buffer, place, count);
    items.set(name, { array, shape });
    place += array.byteLength;
  }
  return { header, arrays: new Arrays(items) };
}

/** Put a header and arrays into one message. */
export function pack(header: object, arrays: Record<string, AnyArray>): ArrayBuffer {
  const listed: Described[] = Object.entries(arrays).map(([name, array]) => ({
    name,
    dtype: nameOf(array),
    shape: [array.length],
  }));
  const text = new TextEncoder().encode(JSON.stringify({ ...header, arrays: listed }));
  const aligned = (n: number) => Math.ceil(n / 8) * 8;
  const start = aligned(4 + text.length);
  const size = Object.values(arrays).reduce((sum, array) => sum + aligned(array.byteLength), start);
  const out = new Uint8Array(size);
  new DataView(out.buffer).setUint32(0, text.length, true);
  out.set(text, 4);
  let place = start;
  for (const array of Object.values(arrays)) {
    out.set(new Uint8Array(array.buffer, array.byteOffset, array.byteLength), place);
    place += aligned(array.byteLength);
  }
  return out.buffer;
}

function nameOf(array: AnyArray): DType {
  for (const [name, kind] of Object.entries(KINDS)) if (array instanceof kind) return name as DType;
  throw new Error("an array of a type that messages do not have");
}
