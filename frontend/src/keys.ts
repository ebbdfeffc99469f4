type Stroke = Pick<KeyboardEvent, "key" | "ctrlKey" | "metaKey" | "altKey" | "shiftKey">;

/** The name of a key stroke as the list writes it. */
export function strokeOf(event: Stroke): string {
  const named: Record<string, string> = {
    " ": "Space",
    ArrowUp: "Up",
    ArrowDown: "Down",
    ArrowLeft: "Left",
    ArrowRight: "Right",
    PageUp: "PgUp",
    PageDown: "PgDn",
    Delete: "Del",
    Escape: "Esc",
  };
  const key = named[event.key] ?? (event.key.length === 1 ? event.key.toUpperCase() : event.key);
  const sign = event.key.length === 1 && event.key.toUpperCase() === event.key.toLowerCase();
  const parts = [
    event.ctrlKey || event.metaKey ? "Ctrl" : "",
    event.altKey ? "Alt" : "",
    event.shiftKey && !sign ? "Shift" : "",
    key,
  ];
  return parts.filter(Boolean).join("+");
}
