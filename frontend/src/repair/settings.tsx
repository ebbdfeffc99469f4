/** The panel of settings: what the surface is made with; to change them is an edit. */
import { useComputed, useSignal } from "@preact/signals";
import { doEdit, opened, settings } from "../part";
import { Button, Check, NumberField, Section, SelectField, TextField } from "../ui/controls";
import {
  changed,
  choiceOf,
  chosenSet,
  defaults,
  deleteSet,
  draft,
  IN_USE,
  idleIn,
  keepSet,
  put,
  renameSet,
  setChoices,
  trouble,
  typed,
  type Value,
  type Values,
  valuesOf,
  volumeShown,
  wrongField,
} from "./choices";
import { SidesPanel } from "./sides";

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

const AUTOMATIC = "automatic";

function words(name: string): string {
  const text = name.replaceAll("_", " ");
  return text[0].toUpperCase() + text.slice(1);
}

function Field({
  name,
  schema,
  values,
  write,
}: {
  name: string;
  schema: Schema;
  values: Values;
  write: (v: Value) => void;
}) {
  const value = values[name];
  const types = [schema.type].flat();
  const label = words(name);
  if (types.includes("boolean")) return <Check label={label} checked={value === true} onChange={write} />;
  if (schema.enum) {
    return (
      <SelectField
        label={label}
        value={value === null ? AUTOMATIC : String(value)}
        options={schema.enum.map((one) => [one ?? AUTOMATIC, one ?? AUTOMATIC] as const)}
        onChange={(one) => write(one === AUTOMATIC && schema.enum?.includes(null) ? null : one)}
      />
    );
  }
  const empty = types.includes("null") ? AUTOMATIC : undefined;
  if (types.includes("string")) {
    return (
      <TextField
        label={label}
        value={String(value ?? "")}
        placeholder={empty}
        onChange={(text) => write(text || null)}
      />
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
      onChange={write}
    />
  );
}

/** The named sets of the scan: to take one up fills the fields, all else is an edit. */
function SetsPanel() {
  const name = useSignal("");
  const sets = settings.value?.sets ?? [];
  // Another window may have deleted it.
  const set = sets.some((one) => one.name === chosenSet.value) ? chosenSet.value : null;
  function take(choice: string): void {
    chosenSet.value = sets.find((one) => choiceOf(one.name) === choice)?.name ?? null;
    typed.value = chosenSet.value === null ? null : valuesOf(choice);
  }
  async function write(done: Promise<boolean>, next: string | null): Promise<void> {
    if (!(await done)) return;
    name.value = "";
    chosenSet.value = next;
  }
  return (
    <Section title="Set of settings">
      <SelectField
        label="Set"
        value={set === null ? IN_USE : choiceOf(set)}
        options={[[IN_USE, IN_USE] as const, ...setChoices()]}
        onChange={take}
      />
      <TextField label="Name" value={name.value} placeholder="name of a set" onChange={(text) => (name.value = text)} />
      <div class="grid-3">
        <Button
          small
          disabled={!name.value && set === null}
          label="Keep these settings as a named set in the scan file"
          onClick={() => void write(keepSet(name.value || (set ?? "")), set)}
        >
          Save
        </Button>
        <Button
          small
          disabled={set === null || !name.value}
          label="Give the chosen set this name"
          onClick={() => void write(renameSet(set ?? "", name.value), name.value)}
        >
          Rename
        </Button>
        <Button
          small
          disabled={set === null}
          label="Delete the chosen set"
          onClick={() => void write(deleteSet(set ?? ""), null)}
        >
          Delete
        </Button>
      </div>
    </Section>
  );
}

export function SettingsPanel() {
  const fields = useComputed(() => Object.entries((opened.value?.fields ?? {}) as unknown as Record<string, Schema>));
  const values = draft.value;
  if (!settings.value || !values) return null;
  const idle = idleIn(values);
  const titles = [...new Set(fields.value.map(([, schema]) => schema.group ?? "Settings"))];

  function write(name: string, value: Value): void {
    const usual = defaults();
    const gone = idleIn({ ...values, [name]: value });
    put({ ...Object.fromEntries(gone.map((one) => [one, usual[one]])), [name]: value });
  }
  function apply(): void {
    void doEdit({ kind: "settings", options: draft.value, name: chosenSet.value ?? "default" });
  }

  return (
    <>
      <SetsPanel />
      {titles.map((group) => (
        <Section key={group} title={group}>
          {group === "Points" && (
            <Check
              label="Show the working volume"
              checked={volumeShown.value}
              onChange={(on) => (volumeShown.value = on)}
            />
          )}
          {group === "Points" && volumeShown.value && (
            <p class="quiet">Drag its handles, or type Radius, Z min and Z max: both do the same.</p>
          )}
          {fields.value.map(([name, schema]) =>
            (schema.group ?? "Settings") !== group || idle.includes(name) ? null : (
              <div key={name} title={schema.description}>
                <Field name={name} schema={schema} values={values} write={(value) => write(name, value)} />
                {wrongField.value === name && (
                  <p class="error" role="alert">
                    {trouble.value?.text}: {trouble.value?.hint}
                  </p>
                )}
              </div>
            ),
          )}
        </Section>
      ))}
      <SidesPanel />
      <div class="action">
        <Button kind="primary" disabled={!changed.value} onClick={apply}>
          Apply
        </Button>
        <div class="grid-2">
          <Button
            disabled={!changed.value}
            onClick={() => {
              typed.value = null;
              chosenSet.value = null;
            }}
          >
            Discard
          </Button>
          <Button onClick={() => (typed.value = defaults())}>Defaults</Button>
        </div>
        <span class="quiet">
          What is typed is tried on some profiles and a patch. Apply makes the whole surface again, with all edits; undo
          leads back. Islands, closing and decimating show in a comparison and in exported files.
        </span>
      </div>
    </>
  );
}
