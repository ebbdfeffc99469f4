/** Why buttons rest for a browser that watches. */
import { ask, isOperator } from "../state";
import { Button } from "./controls";

export function Watching() {
  if (isOperator.value) return null;
  return (
    <div class="remark warning">
      <p>Another browser is the operator: this one watches.</p>
      <Button small onClick={() => void ask({ kind: "take_control" })}>
        Take control here
      </Button>
    </div>
  );
}
