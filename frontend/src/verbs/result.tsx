/** What a verb found out: its tables, and the surface that it wrote. */
import { useEffect, useState } from "preact/hooks";
import { getArrays } from "../link";
import { css } from "../mesh/colours";
import type { MeshModel } from "../mesh/model";
import { DISTINCT } from "../palette";
import { modelOf } from "../part";
import type { FileMeshHeader, ResultFile, ResultTable } from "../protocol";
import { complain } from "../state";
import { Button, SelectField } from "../ui/controls";
import { OwnView } from "./ownview";

const DOTS: Record<string, string> = { pass: "good", fail: "bad", undecided: "busy" };

export function Tables({ of }: { of: readonly ResultTable[] }) {
  return (
    <>
      {of.map(({ title, head, rows }) => (
        <div key={title} class="result-table">
          <table>
            <caption>{title}</caption>
            <thead>
              <tr>
                {head.map((text, k) => (
                  <th key={k} scope="col">
                    {text}
                  </th>
                ))}
              </tr>
            </thead>
            <tbody>
              {rows.map((row, k) => (
                <tr key={k}>
                  {row.map((text, n) => (
                    <td key={n} class="num">
                      {text in DOTS ? (
                        <span class="verdict">
                          <span class={`dot ${DOTS[text]}`} />
                          {text}
                        </span>
                      ) : (
                        text
                      )}
                    </td>
                  ))}
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      ))}
    </>
  );
}

interface Read {
  mesh: MeshModel;
  lasers: readonly string[];
}

type By = "plain" | "laser" | "own";

/** Whether a result is a surface to be shown; a .dxf may be a drawing. */
export const isMesh = (name: string) => /\.(stl|ply|obj|3mf|glb)$/.test(name);

/** The surface in a file, as soon as it is wanted: `open` shows it at once. */
export function ResultSurface({ file, name, open }: Pick<ResultFile, "file" | "name"> & { open: boolean }) {
  const [wanted, want] = useState(open);
  const [read, set] = useState<Read | null>(null);
  const [by, colour] = useState<By>("plain");
  useEffect(() => {
    if (!wanted) return;
    let left = false;
    getArrays<FileMeshHeader>(`api/files/${file}/mesh`).then(({ header, arrays }) => {
      if (left) return;
      const mesh = modelOf(arrays);
      if (arrays.has("colour")) mesh.colour = arrays.u8("colour");
      set({ mesh, lasers: header.lasers });
      colour(mesh.colour ? "own" : header.lasers.length > 1 ? "laser" : "plain");
    }, complain);
    return () => {
      left = true;
    };
  }, [wanted, file]);
  if (!wanted) return <Button onClick={() => want(true)}>Show the surface of {name}</Button>;
  const options: (readonly [By, string])[] = [["plain", "plain"]];
  if (read && read.lasers.length > 1) options.push(["laser", "by pose and laser"]);
  if (read?.mesh.colour) options.push(["own", "colours of the file"]);
  return (
    <div class="pane result">
      <header>
        <h2>{name}</h2>
        <span class="about">{read ? `${read.mesh.faceCount} triangles` : "Loading …"}</span>
        {options.length > 1 && (
          <SelectField bare label="Colours of the result" value={by} options={options} onChange={colour} />
        )}
      </header>
      <OwnView label={`Surface of ${name}`} mesh={read?.mesh ?? null} by={by} />
      {by === "laser" && (
        <p class="key">
          {read?.lasers.map((laser, k) => (
            <span key={laser} class="row">
              <span class="swatch" style={{ background: css(DISTINCT[k % DISTINCT.length]) }} />
              {laser}
            </span>
          ))}
        </p>
      )}
    </div>
  );
}
