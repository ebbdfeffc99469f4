/** The panel of settings: what the surface is made with; to change them is an edit. */
import { useComputed, useSignal, useSignalEffect } from "@preact/signals";
import { doEdit, keepSettings, opened, settings } from "../part";
import { Button, Check, NumberField, Section, SelectField, TextField } from "../ui/controls";

type Value = boolean | number | string | null;
type Values = Record<string, Value>;

/** What one setting may be, in the words of JSON Schema. */
interface Schema {
  type: string | string[];
  enum?: (string | null)[];
  minimum?: number;
  exclusiveMinimum?: number;
  maximum?: number;
  default: Value;
  description: string;
  unit?: string;
  group?: string;
}

const IN_USE = "in use";
const AUTOMATIC = "automatic";
/** Settings of a surface that is closed, and of no other. */
const OF_CLOSING = ["fill", "top", "bottom", "largest_hole"];

function words(name: string): string {
  const text = name.replaceAll("_", " ");
  return text[0].toUpperCase() + text.slice(1);
}

function same(a: Values, b: Values): boolean {
  return Object.keys(a).every((name) => a[name] === b[name]);
}

function Field({ name, schema, draft, put }: { name: string; schema: Schema; draft: Values; put: (v: Value) => void }) {
  const value = draft[name];
  const types = [schema.type].flat();
  const label = words(name);
  if (types.includes("boolean")) return <Check label={label} checked={value === true} onChange={put} />;
  if (schema.enum) {
    return (
      <SelectField
        label={label}
        value={value === null ? AUTOMATIC : String(value)}
        options={schema.enum.map((one) => [one ?? AUTOMATIC, one ?? AUTOMATIC] as const)}
        onChange={(one) => put(one === AUTOMATIC && schema.enum?.includes(null) ? null : one)}
      />
    );
  }
  const empty = types.includes("null") ? AUTOMATIC : undefined;
  if (types.includes("string")) {
    return (
      <TextField label={label} value={String(value ?? "")} placeholder={empty} onChange={(text) => put(text || null)} />
    );
  }
  return (
    <NumberField
      label={label}
      value={value as number | null}
      unit={schema.unit}
      min={schema.minimum ?? schema.exclusiveMinimum}
      max={schema.maximum}
      step={types.includes("integer") ? 1 : undefined}
      placeholder={empty && "auto"}
      onChange={put}
    />
  );
}

export function SettingsPanel() {
  /** What is typed and not yet applied; null for what is in use. */
  const typed = useSignal<Values | null>(null);
  const set = useSignal(IN_USE);
  const keepAs = useSignal("");
  useSignalEffect(() => {
    void settings.value;
    typed.value = null;
    set.value = IN_USE;
  });
  const fields = useComputed(() => Object.entries((opened.value?.fields ?? {}) as unknown as Record<string, Schema>));
  const now = settings.value;
  if (!now) return null;
  const draft = typed.value ?? (now.options as Values);
  const changed = !same(draft, now.options as Values);
  const titles = [...new Set(fields.value.map(([, schema]) => schema.group ?? "Settings"))];

  function put(name: string, value: Value): void {
    const idle = name === "close" && !value ? Object.fromEntries(OF_CLOSING.map((one) => [one, null])) : {};
    typed.value = { ...draft, ...idle, [name]: value };
  }
  function takeSet(name: string): void {
    set.value = name;
    typed.value = (now?.sets.find((one) => one.name === name)?.options ?? null) as Values | null;
  }
  function apply(): void {
    const name = set.value === IN_USE ? "default" : set.value;
    void doEdit({ kind: "settings", options: draft, name });
  }

  async function keep(): Promise<void> {
    if (await keepSettings(keepAs.value)) keepAs.value = "";
  }

  return (
    <>
      <Section title="Set of settings">
        <SelectField
          label="Set"
          value={set.value}
          options={[[IN_USE, IN_USE] as const, ...now.sets.map(({ name }) => [name, name] as const)]}
          onChange={takeSet}
        />
        <TextField
          label="Keep as"
          value={keepAs.value}
          placeholder="name of a set"
          onChange={(name) => (keepAs.value = name)}
        />
        <Button
          disabled={!keepAs.value || changed}
          label="Keep the settings in use under this name in the scan file"
          onClick={() => void keep()}
        >
          Keep the settings in use
        </Button>
      </Section>
      {titles.map((group) => (
        <Section key={group} title={group}>
          {fields.value.map(([name, schema]) =>
            (schema.group ?? "Settings") !== group || (OF_CLOSING.includes(name) && !draft.close) ? null : (
              <div key={name} title={schema.description}>
                <Field name={name} schema={schema} draft={draft} put={(value) => put(name, value)} />
              </div>
            ),
          )}
        </Section>
      ))}
      <div class="action">
        <Button kind="primary" disabled={!changed} onClick={apply}>
          Apply
        </Button>
        <div class="grid-2">
          <Button disabled={!changed} onClick={() => takeSet(IN_USE)}>
            Discard
          </Button>
          <Button
            onClick={() => {
              typed.value = Object.fromEntries(fields.value.map(([name, schema]) => [name, schema.default]));
            }}
          >
            Defaults
          </Button>
        </div>
        <span class="quiet">
          The surface is made again from the pictures, and the edits are done on it again. Undo leads back. Closing and
          decimating show in exported files.
        </span>
      </div>
    </>
  );
}
