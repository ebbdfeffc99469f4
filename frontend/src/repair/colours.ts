/** Colours that the server knows: fetched when they are shown, and again when the surface was changed. */
import { link } from "../bus";
import { getArrays } from "../link";
import type { Colouring } from "../mesh/colours";
import type { MeshModel } from "../mesh/model";
import { mesh, onMesh, opened, shownRevision } from "../part";
import type { MeshHeader } from "../protocol";
import { complain } from "../state";
import { colouring, currentViewport } from "../viewport/place";

/** Gets the colours of a scan: the revision they are of, and what puts them on its surface. */
type Source = (scan: string) => Promise<{ revision: number; put: (model: MeshModel) => void }>;

const SOURCES: Partial<Record<Colouring, Source>> = {
  own: async (scan) => {
    const { header, arrays } = await link.request({ kind: "show_colours", scan });
    if (header.kind !== "colours") throw new Error(header.kind);
    return {
      revision: header.revision,
      put: (model) => {
        model.colour = arrays.u8("colour");
      },
    };
  },
  sigma: async (scan) => {
    const { header, arrays } = await getArrays<MeshHeader>(`api/scans/${scan}/quality`);
    return {
      revision: header.revision,
      put: (model) => {
        model.quality = arrays.f32("sigma");
      },
    };
  },
  edits: async (scan) => {
    const { header, arrays } = await getArrays<MeshHeader>(`api/scans/${scan}/edits`);
    return {
      revision: header.revision,
      put: (model) => {
        model.touch = arrays.u8("touch");
      },
    };
  },
};

let asked = false;

/** Follow what is to be shown: once. */
export function startColours(): void {
  colouring.subscribe(() => void refresh());
  onMesh(() => void refresh());
}

/** One request at a time; a newer surface asks again when the answer is there. */
async function refresh(): Promise<void> {
  const by = colouring.value;
  const scan = by === "own" && !opened.value?.textured ? null : opened.value?.scan;
  const source = SOURCES[by];
  if (!scan || !source || !mesh.value || asked) return;
  asked = true;
  let old = false;
  try {
    const { revision, put } = await source(scan);
    const model = mesh.value;
    old = opened.value?.scan !== scan || revision !== shownRevision() || colouring.value !== by;
    if (old || !model) return;
    put(model);
    currentViewport()?.setColouring(by);
  } catch (error) {
    complain(error);
  } finally {
    asked = false;
  }
  if (old) await refresh();
}
