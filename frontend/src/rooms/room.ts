/** What a room of the page is. */
import type { ComponentType } from "preact";
import type { Command } from "../commands";

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
