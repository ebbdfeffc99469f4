/** The form of any verb, made from its schema. */
import type { VerbEntry } from "../protocol";
import type { Room } from "../rooms/room";
import { go, isOperator } from "../state";
import { Button, Section, TextField } from "../ui/controls";
import { Watching } from "../ui/watching";
import { Field, fieldId } from "./fields";
import { Outcome } from "./outcome";
import { PickPoints } from "./points";
import { ImportPreview, importHelp } from "./preview";
import { type Property, troubles } from "./schema";
import { change, type Form, formOf, resultName, run, runOf, schemaOf, sending, verbHere } from "./state";

/** What is wrong, by the field at which it is said: mistakes seen here, and what the server named. */
function errorsOf(verb: VerbEntry, form: Form): Record<string, string> {
  const seen = form.tried ? troubles(schemaOf(verb), form.values) : {};
  const job = runOf(form);
  const failure = form.refused ?? (job?.state === "failed" ? job : null);
  const named = failure?.options[0]?.name;
  return failure && named ? { [named]: failure.text, ...seen } : seen;
}

function VerbForm({ verb }: { verb: VerbEntry }) {
  const schema = schemaOf(verb);
  const form = formOf(verb);
  const errors = errorsOf(verb, form);
  const all = Object.entries(schema.properties);
  const fields = (some: [string, Property][]) =>
    some.map(([name, property]) => (
      <Field
        key={name}
        verb={verb}
        name={name}
        property={property}
        required={schema.required.includes(name)}
        error={errors[name]}
        help={verb.verb === "import" ? importHelp(verb, name) : undefined}
      />
    ));
  const options = all.filter(([, { role }]) => role === "option");
  const groups = Map.groupBy(options, ([, { group }]) => group ?? "");
  const outputs = all.filter(([, { role }]) => role === "output");
  // Import writes one scan: there is nothing to choose about its format.
  const choosable = outputs.filter(([, { items }]) => items?.enum?.[0] !== ".turnscan");
  const running = runOf(form)?.state === "running";
  return (
    <form
      class="verb"
      aria-label={verb.title}
      onSubmit={(event) => {
        event.preventDefault();
        void run(verb);
      }}
    >
      <header class="row apart">
        <div>
          <h1>{verb.title}</h1>
          <p class="quiet">{schema.description}</p>
        </div>
        <Button onClick={() => go("projects", null)}>All scans</Button>
      </header>
      <Section title="Files to read">{fields(all.filter(([, { role }]) => role === "input"))}</Section>
      {verb.verb === "import" && <ImportPreview verb={verb} />}
      {verb.verb === "join" && <PickPoints verb={verb} />}
      {[...groups].map(([group, some]) => (
        <Section
          key={group}
          title={group || "Options"}
          count={some.length}
          open={group === "" || some.some(([name]) => name in errors)}
        >
          {fields(some)}
        </Section>
      ))}
      {outputs.length > 0 && (
        <Section title="Files to write">
          <div class={`verb-field ${errors.name ? "wrong" : ""}`} id={fieldId("name")}>
            <TextField label="Name" value={resultName(verb)} onChange={(name) => change(verb, { name })} />
            <p class="quiet">Of what is written into the folder of the scans.</p>
            {errors.name && (
              <p class="error" role="alert">
                {errors.name}
              </p>
            )}
          </div>
          {fields(choosable)}
        </Section>
      )}
      <div class="action">
        <button type="submit" class="button primary" disabled={running || !isOperator.value || sending.value !== null}>
          {verb.title}
        </button>
        <Watching />
        {form.tried && Object.keys(errors).length > 0 && !running && (
          <span class="error">Correct what is marked above.</span>
        )}
      </div>
      <Outcome verb={verb} />
    </form>
  );
}

function VerbPage() {
  const verb = verbHere.value;
  return (
    <div class="room single">
      {verb ? <VerbForm key={verb.verb} verb={verb} /> : <p class="empty">There is nothing of this name here.</p>}
    </div>
  );
}

export const verbRoom: Room = { id: "do", title: "Files", needsScan: false, View: VerbPage, commands: [] };
