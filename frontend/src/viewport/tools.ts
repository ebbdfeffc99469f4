/** What the left button can do. */
export const TOOLS = [
  "navigate",
  "box",
  "lasso",
  "polygon",
  "brush",
  "connected",
  "angle",
  "smooth",
  "bridge",
  "cut",
] as const;
export type Tool = (typeof TOOLS)[number];
