/** Colours from texture images: fetched when they are shown, and again when the surface was changed. */
import { link } from "../bus";
import { mesh, onMesh, opened, shownRevision } from "../part";
import { complain } from "../state";
import { colouring, currentViewport } from "../viewport/place";

let asked = false;

/** Follow what is to be shown: once. */
export function startColours(): void {
  colouring.subscribe(() => void refresh());
  onMesh(() => void refresh());
}

/** One request at a time; a newer surface asks again when the answer is there. */
async function refresh(): Promise<void> {
  const scan = opened.value?.textured ? opened.value.scan : null;
  if (!scan || !mesh.value || colouring.value !== "own" || asked) return;
  asked = true;
  let old = false;
  try {
    const { header, arrays } = await link.request({ kind: "show_colours", scan });
    const model = mesh.value;
    if (header.kind !== "colours") return;
    old = opened.value?.scan !== scan || header.revision !== shownRevision();
    if (old || !model) return;
    model.colour = arrays.u8("colour");
    if (colouring.value === "own") currentViewport()?.setColouring("own");
  } catch (error) {
    complain(error);
  } finally {
    asked = false;
  }
  if (old) await refresh();
}
