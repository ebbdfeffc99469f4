/** What the devices send while they work: live pictures, growing points, the course of a scan. */
import { effect, signal } from "@preact/signals";
import { link, on } from "../bus";
import { kept } from "../kept";
import type { Found, Scanning, Seen } from "../protocol";
import { complain, devices } from "../state";
import type { ShownPicture } from "./picture";

export interface LivePicture extends ShownPicture {
  header: Seen;
  /** px rms of the light in each line of the stripe, and grey levels of it; NaN where there is none. */
  width: Float32Array;
  signal: Float32Array;
  /** Pixels in equal bins from black to the largest possible value. */
  histogram: Uint32Array;
}

/** Of the stripe in the picture. */
export const orientation = kept<Seen["orientation"]>("orientation", "vertical", ["vertical", "horizontal"]);
export const picture = signal<LivePicture | null>(null);
export const scanning = signal<Scanning | null>(null);
export const found = signal<Found | null>(null);
export const finding = signal(false);

export const isScanning = () => scanning.value?.state === "running" || scanning.value?.state === "paused";

/** The points of the scan that is being taken, by laser; `count` tells when there are more. */
export class Cloud {
  private readonly parts = new Map<string, Float32Array[]>();
  count = 0;

  add(laser: string, points: Float32Array): void {
    const known = this.parts.get(laser);
    if (known) known.push(points);
    else this.parts.set(laser, [points]);
    this.count += points.length / 3;
  }

  get lasers(): string[] {
    return [...this.parts.keys()];
  }

  of(laser: string): readonly Float32Array[] {
    return this.parts.get(laser) ?? [];
  }
}

export const cloud = signal(new Cloud());
export const cloudSize = signal(0);
let cloudOf = "";

/** Follow what the devices send: once. */
export function startLive(): void {
  on("frame", (header, arrays) => {
    const jpeg = new Blob([new Uint8Array(arrays.u8("jpeg"))], { type: "image/jpeg" });
    createImageBitmap(jpeg)
      .then((image) => {
        picture.value?.image.close();
        picture.value = {
          header,
          image,
          stripe: arrays.f32("stripe"),
          corners: arrays.f32("corners"),
          width: arrays.f32("stripe_width"),
          signal: arrays.f32("stripe_signal"),
          histogram: arrays.u32("histogram"),
        };
      })
      .catch(() => {}) // a picture that cannot be shown is followed by another
      .finally(() => link.send({ kind: "ack", number: header.number }));
  });
  on("scanning", (message) => {
    if (message.scan !== cloudOf && message.state === "running") {
      cloudOf = message.scan;
      cloud.value = new Cloud();
      cloudSize.value = 0;
    }
    scanning.value = message;
  });
  on("points", (message, arrays) => {
    if (message.scan !== cloudOf) return;
    cloud.value.add(message.laser, arrays.f32("points"));
    cloudSize.value = cloud.value.count;
  });
  effect(() => {
    // A picture of devices that are gone is not live any more.
    if (devices.value?.camera.state === "none") picture.value = null;
  });
}

export async function findDevices(probe: boolean): Promise<void> {
  finding.value = true;
  try {
    const { header } = await link.request({ kind: "find_devices", probe });
    if (header.kind === "found") found.value = header;
  } catch (error) {
    complain(error);
  } finally {
    finding.value = false;
  }
}
