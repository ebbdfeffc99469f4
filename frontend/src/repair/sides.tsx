/** Two settings side by side: both surfaces, coloured by how far they lie apart. */
import { useSignal } from "@preact/signals";
import { colourVertices } from "../mesh/colours";
import { shape, shownRevision } from "../part";
import { Button, bound, count, NumberField, Section, SelectField } from "../ui/controls";
import { OwnView } from "../verbs/ownview";
import { choices, compareSides, comparing, DEFAULTS, IN_USE, mapEnd, sides } from "./choices";
import { MapKey } from "./mapkey";

const cm2 = (mm2: number) => `${(mm2 / 100).toFixed(2)} cm²`;

/** mm at the ends of the map of both surfaces. */
function endOf(): number {
  if (mapEnd.value !== null) return mapEnd.value;
  const ends = (sides.value?.meshes ?? []).map((mesh) => {
    mesh.deviationEnd = null;
    return colourVertices(mesh, "deviation").legend?.high ?? 0;
  });
  return Math.max(...ends, 0.001);
}

export function SidesView() {
  const now = sides.value;
  if (!now) return null;
  const end = endOf();
  for (const mesh of now.meshes) mesh.deviationEnd = end;
  return (
    <div class="views pairwise">
      {now.meshes.map((mesh, k) => (
        <section class="pane" key={`${k} ${end}`} aria-label={`Settings ${now.names[k]}`}>
          <header>
            <h2>{now.names[k]}</h2>
            <span class="about">
              {count(mesh.vertexCount)} vertices · {cm2(now.header.areas[k])}
            </span>
            {k === 1 && (
              <Button kind="plain" small icon="close" label="End the comparison" onClick={() => (sides.value = null)} />
            )}
          </header>
          <OwnView label={`Surface ${k + 1}: ${now.names[k]}`} mesh={mesh} by="deviation" together="sides" />
          <div class="key">
            <MapKey end={end} from={`“${now.names[1 - k]}”`} />
          </div>
        </section>
      ))}
    </div>
  );
}

function signed(mm: number): string {
  return `${mm < 0 ? "−" : "+"}${Math.abs(mm).toFixed(4)} mm`;
}

export function SidesPanel() {
  const first = useSignal(IN_USE);
  const second = useSignal(DEFAULTS);
  void shape.value;
  const options = choices();
  const known = (name: string) => (options.some(([one]) => one === name) ? name : IN_USE);
  const [a, b] = [known(first.value), known(second.value)];
  const now = sides.value;
  return (
    <Section title="Compare two settings" open={false}>
      <SelectField label="First" options={options} value={a} onChange={(name) => (first.value = name)} />
      <SelectField label="Second" options={options} value={b} onChange={(name) => (second.value = name)} />
      <Button
        kind="primary"
        disabled={a === b || comparing.value}
        onClick={() => void compareSides(a, b, shownRevision())}
      >
        {comparing.value ? "Reconstructing both …" : "Compare"}
      </Button>
      {now && (
        <>
          <dl class="figures" aria-label="Difference of the two settings">
            <dt>Vertices</dt>
            <dd class="num">{now.meshes.map((one) => count(one.vertexCount)).join(" → ")}</dd>
            <dt>Area</dt>
            <dd class="num">{now.header.areas.map(cm2).join(" → ")}</dd>
            <dt>Area won</dt>
            <dd class="num">{cm2(now.header.won)}</dd>
            <dt>Area lost</dt>
            <dd class="num">{cm2(now.header.lost)}</dd>
            <dt>Mean distance</dt>
            <dd class="num">{signed(now.header.mean)}</dd>
            <dt>Root mean square</dt>
            <dd class="num">{now.header.rms.toFixed(4)} mm</dd>
            <dt>95 % within</dt>
            <dd class="num">{now.header.p95.toFixed(4)} mm</dd>
            <dt>Worst</dt>
            <dd class="num">{now.header.worst.toFixed(3)} mm</dd>
          </dl>
          {now.revision !== shownRevision() && (
            <p class="remark warning">The surface was changed since. Compare again.</p>
          )}
          <NumberField label="Map to ±" unit="mm" min={0.001} placeholder="all" {...bound(mapEnd)} />
          <Button onClick={() => (sides.value = null)}>End the comparison</Button>
        </>
      )}
    </Section>
  );
}
