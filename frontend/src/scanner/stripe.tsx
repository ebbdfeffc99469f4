/** How the stripe lies in the picture: one choice for live pictures, calibration and scans. */
import { SelectField } from "../ui/controls";
import { orientation } from "./live";

export function StripeField() {
  const options = [
    ["vertical", "upright"],
    ["horizontal", "lying"],
  ] as const;
  return (
    <SelectField
      label="Stripe"
      value={orientation.value}
      options={options}
      onChange={(value) => (orientation.value = value)}
    />
  );
}
