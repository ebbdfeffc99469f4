/** Fields of a verb's form, each made from a property of its schema. */
import type { ComponentChildren } from "preact";
import { useId, useRef, useState } from "preact/hooks";
import type { VerbEntry } from "../protocol";
import { chosenFolder, dropped } from "../start/folders";
import { scans } from "../state";
import { Button, Check, SelectField, TextField } from "../ui/controls";
import { fieldOf, fromText, isMany, labelOf, type Property, takes, toText, whatIs } from "./schema";
import { change, files, formOf, send } from "./state";

interface FieldProps {
  verb: VerbEntry;
  name: string;
  property: Property;
  required: boolean;
  error: string | undefined;
  /** What helps to fill the field in. */
  help?: ComponentChildren;
}

/** The id of a field, to which remedies and errors lead. */
export const fieldId = (name: string) => `field-${name}`;

export function goTo(name: string): void {
  const field = document.getElementById(fieldId(name));
  for (let at = field; at; at = at.parentElement) if (at instanceof HTMLDetailsElement) at.open = true;
  field?.scrollIntoView({ block: "center" });
  field?.querySelector<HTMLElement>("input, select, button")?.focus();
}

export function Field({ verb, name, property, required, error, help }: FieldProps) {
  const about = useId();
  const kind = fieldOf(property);
  return (
    <div class={`verb-field ${error ? "wrong" : ""}`} id={fieldId(name)} role="group" aria-describedby={about}>
      {kind === "files" ? (
        <FileField verb={verb} name={name} property={property} required={required} />
      ) : (
        <ValueField verb={verb} name={name} property={property} required={required} />
      )}
      {help}
      <p class="quiet" id={about}>
        {property.description}
      </p>
      {error && (
        <p class="error" role="alert">
          {error}
        </p>
      )}
    </div>
  );
}

function ValueField({ verb, name, property, required }: Omit<FieldProps, "error" | "help">) {
  const label = labelOf(name);
  const value = formOf(verb).values[name];
  const set = (to: unknown) => change(verb, { values: { ...formOf(verb).values, [name]: to } });
  switch (fieldOf(property)) {
    case "tick":
      return <Check label={label} checked={value === true} onChange={set} />;
    case "choice":
      return (
        <SelectField
          label={label}
          value={value === null ? "" : String(value)}
          options={(property.enum ?? []).map((one) => [one ?? "", one ?? "automatic"] as const)}
          onChange={(to) => set(to === "" ? null : to)}
        />
      );
    case "choices":
    case "suffixes": {
      const all = (property.items?.enum ?? []) as string[];
      const on = value as string[];
      return (
        <fieldset class="ticks">
          <legend>{label}</legend>
          {all.map((one) => (
            <Check
              key={one}
              label={property.role === "output" ? one.slice(1).toUpperCase() : one}
              checked={on.includes(one)}
              onChange={(tick) => set(all.filter((other) => (other === one ? tick : on.includes(other))))}
            />
          ))}
        </fieldset>
      );
    }
    default:
      return (
        <TextField
          label={label}
          value={toText(value)}
          unit={property.unit}
          placeholder={isMany(property) ? "several with ;" : required ? "" : "automatic"}
          onChange={(text) => set(fromText(property, text))}
        />
      );
  }
}

/** Files of the library or from this computer: one, or several in the order in which they are chosen. */
function FileField({ verb, name, property, required }: Omit<FieldProps, "error" | "help">) {
  const input = useRef<HTMLInputElement>(null);
  const folder = useRef<HTMLInputElement>(null);
  const [over, setOver] = useState(false);
  const many = isMany(property);
  const value = formOf(verb).values[name];
  const picked = [value].flat().filter(Boolean) as string[];
  const set = (to: readonly string[]) =>
    change(verb, { values: { ...formOf(verb).values, [name]: many ? to : (to.at(-1) ?? "") } });
  const offered: (readonly [string, string, string])[] = [
    ...(takes(property, ["scan"]) ? scans.value : []).map((one) => [one.scan, one.name, "a scan"] as const),
    ...files.value
      .filter(({ kinds }) => takes(property, kinds))
      .map((one) => [one.file, one.name, whatIs(one)] as const),
  ];
  const add = async (list: Iterable<File> | null) => {
    const sent = new Set(await send(list ?? []));
    const fitting = [...sent].filter(
      (one) =>
        files.value.some(({ file, kinds }) => file === one && takes(property, kinds)) ||
        (takes(property, ["scan"]) && scans.value.some(({ scan }) => scan === one)),
    );
    if (fitting.length) set([...picked.filter((one) => !sent.has(one)), ...fitting]);
  };
  const label = labelOf(name);
  return (
    <div
      role="group"
      aria-label={label}
      class={`files ${over ? "over" : ""}`}
      onDragOver={(event) => {
        event.preventDefault();
        setOver(true);
      }}
      onDragLeave={() => setOver(false)}
      onDrop={(event) => {
        event.preventDefault();
        event.stopPropagation();
        setOver(false);
        void dropped(event.dataTransfer).then(add);
      }}
    >
      {many ? (
        <>
          <span class="label">{label}</span>
          {offered.map(([file, text, what]) => (
            <Check
              key={file}
              label={`${picked.includes(file) && picked.length > 1 ? `${picked.indexOf(file) + 1}. ` : ""}${text} (${what})`}
              checked={picked.includes(file)}
              onChange={(on) => set(on ? [...picked, file] : picked.filter((one) => one !== file))}
            />
          ))}
        </>
      ) : (
        <SelectField
          label={label}
          value={picked[0] ?? ""}
          options={[
            ["", required ? "choose …" : "none"] as const,
            ...offered.map(([file, text, what]) => [file, `${text} (${what})`] as const),
          ]}
          onChange={(to) => set(to ? [to] : [])}
        />
      )}
      <span class="row">
        <Button small onClick={() => input.current?.click()}>
          From this computer
        </Button>
        {takes(property, ["pictures"]) && (
          <Button small onClick={() => folder.current?.click()}>
            A folder
          </Button>
        )}
        <span class="quiet">or drop {many ? "files" : "a file"} here</span>
      </span>
      <input
        ref={input}
        type="file"
        multiple
        hidden
        aria-label={`${label} from this computer`}
        onChange={(event) => void add(event.currentTarget.files)}
      />
      <input
        ref={(element) => {
          folder.current = element;
          if (element) element.webkitdirectory = true;
        }}
        type="file"
        hidden
        aria-label={`${label} from a folder of this computer`}
        onChange={(event) => void chosenFolder(event.currentTarget.files ?? []).then(add)}
      />
    </div>
  );
}
