/** Shapes found in the scan: each on the surface and in a list, with every size. */
import { computed, signal } from "@preact/signals";
import { link } from "../bus";
import { css } from "../mesh/colours";
import { DISTINCT } from "../palette";
import { mesh, onMesh, opened, shownRevision } from "../part";
import type { ShapesShown } from "../protocol";
import { complain, notify } from "../state";
import { Button, Section } from "../ui/controls";
import { Tables } from "../verbs/result";
import { colourAnew, currentViewport } from "../viewport/place";

const shown = signal<ShapesShown | null>(null);
/** The surface was changed since. */
const old = signal(false);
const busy = signal(false);

const here = computed(() => (shown.value?.scan === opened.value?.scan ? shown.value : null));

/** Follow the surface: once. */
export function startShapes(): void {
  onMesh(() => {
    old.value = true;
  });
}

async function find(): Promise<void> {
  const scan = opened.value?.scan;
  if (!scan || busy.value) return;
  busy.value = true;
  try {
    const { header, arrays } = await link.request({ kind: "find_shapes", scan });
    const model = mesh.value;
    if (header.kind !== "shapes" || !model || opened.value?.scan !== scan) return;
    if (header.revision !== shownRevision()) {
      notify("warning", "The surface was changed meanwhile.", "find the shapes again");
      return;
    }
    model.shapes = arrays.i32("shape");
    shown.value = header;
    old.value = false;
    colourAnew("shapes");
  } catch (error) {
    complain(error);
  } finally {
    busy.value = false;
  }
}

export function ShapesPanel() {
  const now = here.value;
  return (
    <Section title="Shapes" open={false}>
      <p class="quiet">Planes, cylinders, spheres, cones and tori that the part is made of.</p>
      <Button disabled={busy.value} onClick={() => void find()}>
        Find shapes
      </Button>
      {now && (
        <>
          {old.value && <p class="quiet">Of an earlier surface: find them again.</p>}
          <p class="num" role="status">
            {now.shapes.length} shapes, {(100 * now.coverage).toFixed(0)} % of the measured surface
          </p>
          <ul class="list" aria-label="Shapes of the part">
            {now.shapes.map(({ text, place, size }, i) => (
              <li key={i}>
                <button
                  type="button"
                  class="button plain grow"
                  title="Zoom to this shape"
                  onClick={() => currentViewport()?.lookAt([...place], Math.max(size, 4))}
                >
                  <span class="swatch" style={{ background: css(DISTINCT[i % DISTINCT.length]) }} />
                  <span>
                    {i + 1}. {text}
                  </span>
                </button>
              </li>
            ))}
          </ul>
          {now.relations.length > 0 && (
            <ul class="quiet" aria-label="Relations of the shapes">
              {now.relations.map((text) => (
                <li key={text}>{text}</li>
              ))}
            </ul>
          )}
          <Tables of={[now.dimensions]} />
        </>
      )}
    </Section>
  );
}
