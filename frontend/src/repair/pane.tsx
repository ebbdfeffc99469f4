import type { ComponentChildren } from "preact";
import { Button } from "../ui/controls";
import { type Large, large } from "./state";

interface PaneProps {
  name: Large;
  title: string;
  about?: ComponentChildren;
  tools?: ComponentChildren;
  /** What the colours mean, under the view. */
  foot?: ComponentChildren;
  children: ComponentChildren;
}

/** One view with its title line; the button makes it fill the room. */
export function Pane({ name, title, about, tools, foot, children }: PaneProps) {
  const isLarge = large.value === name;
  return (
    <section class={`pane ${name}`} aria-label={title}>
      <header>
        <h2>{title}</h2>
        <span class="about" title={typeof about === "string" ? about : undefined}>
          {about}
        </span>
        {tools}
        <Button
          kind="plain"
          small
          icon="large"
          label={isLarge ? "All views" : `${title} alone`}
          pressed={isLarge}
          onClick={() => (large.value = isLarge ? null : name)}
        />
      </header>
      <div class="stage">{children}</div>
      {foot}
    </section>
  );
}
