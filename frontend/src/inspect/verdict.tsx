/** Whether limits are kept, by ISO 14253-1. */
import type { Measure } from "../protocol";

export type Verdict = NonNullable<Measure["verdict"]>;

const VERDICTS: Record<Verdict, readonly [string, string, string]> = {
  pass: ["good", "passes", "Within the limits, whatever the uncertainty."],
  fail: ["bad", "fails", "Outside of the limits, whatever the uncertainty."],
  undecided: ["busy", "undecided", "Nearer to a limit than the uncertainty: neither passed nor failed (ISO 14253-1)."],
};

export function VerdictDot({ of }: { of: Verdict }) {
  const [dot, word, why] = VERDICTS[of];
  return (
    <span class="verdict" title={why}>
      <span class={`dot ${dot}`} />
      {word}
    </span>
  );
}
