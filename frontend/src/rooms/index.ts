/** The rooms in the order of the work; a room is a file beside this one. */
import type { ComponentType } from "preact";
import type { Command } from "../commands";
import { exporting } from "./export";
import { measure } from "./measure";
import { mend } from "./mend";
import { projects } from "./projects";
import { rig } from "./rig";
import { scan } from "./scan";

export interface Room {
  id: string;
  title: string;
  /** Whether it shows a scan, and cannot be entered without one. */
  needsScan: boolean;
  View: ComponentType;
  /** At the end of the status line. */
  Status?: ComponentType;
  commands: readonly Command[];
}

export const home: Room = projects;
export const rooms: readonly Room[] = [rig, scan, mend, measure, exporting];
