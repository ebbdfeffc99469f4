/** The few controls that all rooms are made of. */
import type { Signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useId, useState } from "preact/hooks";
import { Icon, type IconName } from "./icons";

interface ButtonProps {
  children?: ComponentChildren;
  icon?: IconName;
  label?: string;
  keys?: string;
  kind?: "primary" | "danger" | "plain";
  small?: boolean;
  pressed?: boolean;
  disabled?: boolean;
  onClick: () => void;
}

/** A button; without children the label is its tooltip and its name for screen readers. */
export function Button({ children, icon, label, keys, kind, small, pressed, disabled, onClick }: ButtonProps) {
  const tip = [label, keys && `(${keys})`].filter(Boolean).join(" ");
  return (
    <button
      type="button"
      class={`button ${kind ?? ""} ${small ? "small" : ""}`}
      title={tip || undefined}
      aria-label={children ? undefined : label}
      aria-pressed={pressed}
      aria-keyshortcuts={keys?.replace("Ctrl", "Control").replace(/\s/g, "") || undefined}
      disabled={disabled}
      onClick={onClick}
    >
      {icon && <Icon name={icon} />}
      {children}
    </button>
  );
}

interface SectionProps {
  title: string;
  count?: ComponentChildren;
  open?: boolean;
  children: ComponentChildren;
}

/** What a person opened and closed, by its title: panels come and go with their tab. */
const opened = new Map<string, boolean>();

/** Open a section of the panel that is shown, and put the keyboard there. */
export function openSection(title: string): void {
  // What was just chosen is on the page only after this turn.
  setTimeout(() => {
    const section = document.querySelector<HTMLDetailsElement>(`details.section[data-title="${title}"]`);
    if (!section) return;
    section.open = true;
    opened.set(title, true);
    section.scrollIntoView({ block: "nearest" });
    section.querySelector("summary")?.focus();
  });
}

export function Section({ title, count, open = true, children }: SectionProps) {
  return (
    <details
      class="section"
      data-title={title}
      open={opened.get(title) ?? open}
      onToggle={({ currentTarget: { open: now } }) => {
        if (now !== (opened.get(title) ?? open)) opened.set(title, now);
      }}
    >
      <summary>
        {title}
        {count !== undefined && <span class="count num">{count}</span>}
      </summary>
      <div class="body">{children}</div>
    </details>
  );
}

interface NumberProps {
  label: string;
  value: number | null;
  unit?: string;
  min?: number;
  max?: number;
  step?: number;
  placeholder?: string;
  onChange: (value: number | null) => void;
}

/**
 * What is being typed, which a message of the server that draws the panel anew must not take away:
 * the field shows its value again when the text is handed in or the field is left.
 */
function useDraft(value: string) {
  const [text, write] = useState<string | null>(null);
  const end = () => write(null);
  return {
    end,
    props: {
      value: text ?? value,
      onInput: (event: { currentTarget: HTMLInputElement }) => {
        // A number that is not finished has no text yet ("-", "1e"): the field itself keeps it.
        if (!event.currentTarget.validity.badInput) write(event.currentTarget.value);
      },
      onBlur: end,
    },
  };
}

/** A number with its unit; empty is null where there is a placeholder. */
export function NumberField({ label, value, unit, min, max, step, placeholder, onChange }: NumberProps) {
  const id = useId();
  const draft = useDraft(value === null ? "" : String(Number(value.toFixed(4))));
  return (
    <div class="field">
      <label for={id}>{label}</label>
      <span class="with-unit" style={{ "--unit": unit?.length ?? 0 }}>
        <input
          id={id}
          type="number"
          {...draft.props}
          min={min}
          max={max}
          step={step ?? "any"}
          placeholder={placeholder}
          onChange={(event) => {
            const { value: text, valueAsNumber, validity } = event.currentTarget;
            if (!validity.valid) {
              event.currentTarget.reportValidity();
              return;
            }
            draft.end();
            if (text !== "") onChange(valueAsNumber);
            else if (placeholder !== undefined) onChange(null);
          }}
        />
        {unit && <span>{unit}</span>}
      </span>
    </div>
  );
}

interface TextProps {
  label: string;
  value: string;
  unit?: string;
  placeholder?: string;
  onChange: (value: string) => void;
}

export function TextField({ label, value, unit, placeholder, onChange }: TextProps) {
  const id = useId();
  const draft = useDraft(value);
  return (
    <div class="field text">
      <label for={id}>{label}</label>
      <span class="with-unit" style={{ "--unit": unit?.length ?? 0 }}>
        <input
          id={id}
          type="text"
          {...draft.props}
          placeholder={placeholder}
          spellcheck={false}
          onChange={(event) => {
            draft.end();
            onChange(event.currentTarget.value.trim());
          }}
        />
        {unit && <span>{unit}</span>}
      </span>
    </div>
  );
}

interface SelectProps<T extends string> {
  label: string;
  value: T;
  options: readonly (readonly [T, string])[];
  bare?: boolean;
  onChange: (value: T) => void;
}

/** A choice; `bare` shows no label but has one for screen readers. */
export function SelectField<T extends string>({ label, value, options, bare, onChange }: SelectProps<T>) {
  const id = useId();
  const select = (
    <select
      id={id}
      value={value}
      aria-label={bare ? label : undefined}
      onChange={(event) => onChange(event.currentTarget.value as T)}
    >
      {options.map(([option, text]) => (
        <option key={option} value={option}>
          {text}
        </option>
      ))}
    </select>
  );
  if (bare) return select;
  return (
    <div class="field">
      <label for={id}>{label}</label>
      {select}
    </div>
  );
}

export function Check({
  label,
  keys,
  checked,
  onChange,
}: {
  label: string;
  keys?: string;
  checked: boolean;
  onChange: (on: boolean) => void;
}) {
  return (
    <label class="check" title={keys && `${label} (${keys})`}>
      <input type="checkbox" checked={checked} onChange={(event) => onChange(event.currentTarget.checked)} />
      {label}
    </label>
  );
}

export function mm(value: number): string {
  return `${value.toFixed(Math.abs(value) < 10 ? 3 : 2)} mm`;
}

/** What a field needs to show a signal and to set it. */
export function bound<T>(to: Signal<T>): { value: T; onChange: (value: T) => void } {
  return {
    value: to.value,
    onChange: (value) => {
      to.value = value;
    },
  };
}

/** So many significant digits, and never a power of ten for what people write out. */
export function figure(value: number, digits: number): string {
  return String(Number(value.toPrecision(digits)));
}

export function count(n: number): string {
  return n.toLocaleString("en").replaceAll(",", " ");
}
