/** Icons as strokes on a 20 × 20 field. */

const PATHS = {
  logo: "M4 15c0 1.4 2.7 2.4 6 2.4s6-1 6-2.4M7 4c0 3.4 1.2 3.4 1.2 5.6S6.6 12 6.6 14.4M13 4c0 3.4-1.2 3.4-1.2 5.6s1.6 2.4 1.6 4.8M10 2.5v12",
  navigate: "M5 3l10.5 6.2-4.6 1.1 2.7 4.9-2 1.1-2.7-4.9L5 14.6z",
  box: "M4 4h12v12H4z",
  lasso: "M10 4c4 0 7 1.8 7 4.4S14 13 10 13s-7-1.8-7-4.4S6 4 10 4zM6.5 12.6c-1.4 1.6.6 2.8-.6 4.6",
  polygon: "M4 7l6-4 6 5-3 8H6z",
  brush: "M16.5 3.5L9 11M7.6 10.6c1.6.2 2.4 1.2 2.2 2.4-.4 2.2-3 3.2-6 3 1.6-1 1-3 1.8-4.2.5-.8 1.2-1.2 2-1.2z",
  connected: "M3 13l4-7 5 2 5-4M7 6l2 10 8-3-5-5M3 13l6 3",
  angle: "M3 15L10 5l7 10M10 5v10M6.4 10.2c1 .9 2 1.3 3.6 1.3",
  smooth: "M2.5 12c2.5 0 2.5-5 5-5s2.5 6 5 6 2.5-4 5-4",
  cut: "M3 14l10-10 4 2-10 10zM2 9h3M15 13h3M10 2v2",
  eye: "M2 10c2-3.6 4.7-5.4 8-5.4s6 1.8 8 5.4c-2 3.6-4.7 5.4-8 5.4S4 13.6 2 10zM10 12.4a2.4 2.4 0 1 0 0-4.8 2.4 2.4 0 0 0 0 4.8z",
  undo: "M7 5L3.5 8.5 7 12M4 8.5h7a4.5 4.5 0 0 1 0 9H8",
  redo: "M13 5l3.5 3.5L13 12M16 8.5H9a4.5 4.5 0 0 0 0 9h3",
  fit: "M3 7V3h4M13 3h4v4M17 13v4h-4M7 17H3v-4M7.5 7.5h5v5h-5z",
  trash: "M4 6h12M8 6V4h4v2M6 6l.8 10.5h6.4L14 6M8.6 9v5M11.4 9v5",
  sun: "M10 6.5a3.5 3.5 0 1 0 0 7 3.5 3.5 0 0 0 0-7zM10 2v2M10 16v2M2 10h2M16 10h2M4.3 4.3l1.4 1.4M14.3 14.3l1.4 1.4M15.7 4.3l-1.4 1.4M5.7 14.3l-1.4 1.4",
  help: "M7.4 7.4a2.7 2.7 0 1 1 3.8 2.6c-.8.4-1.2.9-1.2 1.8M10 14.6v.2M10 2.5a7.5 7.5 0 1 0 0 15 7.5 7.5 0 0 0 0-15z",
  search: "M9 3.5a5.5 5.5 0 1 0 0 11 5.5 5.5 0 0 0 0-11zM13.2 13.2L17 17",
  large: "M11.5 3.5h5v5M8.5 16.5h-5v-5M16.5 3.5L11.6 8.4M3.5 16.5l4.9-4.9",
  history: "M10 3a7 7 0 1 1-6.6 4.6M3 3.4v4.2h4.2M10 6.4V10l2.6 1.8",
  close: "M5 5l10 10M15 5L5 15",
  left: "M12.5 4L6.5 10l6 6",
  right: "M7.5 4l6 6-6 6",
  ruler: "M3 13L13 3l4 4L7 17zM6 10l1.6 1.6M8.4 7.6L10 9.2M10.8 5.2l1.6 1.6",
  camera: "M3 6.5h3l1.4-2h5.2l1.4 2h3v9H3zM10 8.2a2.8 2.8 0 1 0 0 5.6 2.8 2.8 0 0 0 0-5.6z",
  play: "M6 4l10 6-10 6z",
  pause: "M7 4v12M13 4v12",
  export: "M10 3v9M6.5 6.5L10 3l3.5 3.5M4 12v4.5h12V12",
  point: "M10 2.5v4M10 13.5v4M2.5 10h4M13.5 10h4M10 8.5a1.5 1.5 0 1 0 0 3 1.5 1.5 0 0 0 0-3z",
} as const;

export type IconName = keyof typeof PATHS;

export function Icon({ name }: { name: IconName }) {
  return (
    <svg viewBox="0 0 20 20" fill="none" stroke="currentColor" stroke-width="1.5" stroke-linecap="round" stroke-linejoin="round" aria-hidden="true">
      <path d={PATHS[name]} />
    </svg>
  );
}
