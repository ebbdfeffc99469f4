/** The rooms in the order of the work; a room is a file beside this one. */
import { exporting } from "./export";
import { measure } from "./measure";
import { projects } from "./projects";
import { repair } from "./repair";
import { rig } from "./rig";
import type { Room } from "./room";
import { scan } from "./scan";

export const home: Room = projects;
export const rooms: readonly Room[] = [rig, scan, repair, measure, exporting];
