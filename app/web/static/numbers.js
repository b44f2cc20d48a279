"use strict";
/* Numbers for people: rounded to what they mean, with "–" for what is not known. */

const NOISE_RAD = 1e-6; // angles differ by less than this through rounding alone: smaller values are not shown as digits
const SUPERSCRIPTS = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };

const known = (value) => typeof value === "number" && Number.isFinite(value);
const power = (exponent) => `10${[...String(exponent)].map((sign) => SUPERSCRIPTS[sign]).join("")}`;
const magnitude = (value) => Math.floor(Math.log10(Math.abs(value)));
const plainSize = (size) => size === 0 || (size >= 1e-3 && size < 1e7); // written without a power of ten

const show = {
  number: (value, digits = 3) => {
    if (!known(value)) return "–";
    if (plainSize(Math.abs(value))) return value.toLocaleString("en", { maximumSignificantDigits: digits });
    const [mantissa, exponent] = value.toExponential(digits - 1).split("e");
    return `${mantissa}·${power(Number(exponent))}`;
  },
  count: (value) => (known(value) ? value.toLocaleString("en", { maximumFractionDigits: 0 }) : "–"),
  /* A sum of squared angle errors or a variation, rad². */
  cost: (value) => (known(value) && value !== 0 && Math.abs(value) < NOISE_RAD ** 2 ? `< ${power(magnitude(NOISE_RAD ** 2))}` : show.number(value)),
  /* An angle, given in rad. */
  milliradians: (value) => {
    if (!known(value)) return "–";
    if (value !== 0 && Math.abs(value) < NOISE_RAD) return `< ${NOISE_RAD * 1000}`;
    const angle = value * 1000, decimals = angle === 0 ? 0 : Math.min(Math.max(2 - magnitude(angle), 0), 3);
    return angle.toLocaleString("en", { minimumFractionDigits: decimals, maximumFractionDigits: decimals });
  },
  percent: (share) => (known(share) ? (share !== 0 && Math.abs(share) < 1e-4 ? "< 0.01 %" : `${show.number(share * 100, 2)} %`) : "–"),
  milliseconds: (seconds) => (known(seconds) ? show.number(seconds * 1000) : "–"),
  duration: (seconds) => {
    if (!known(seconds)) return "–";
    if (seconds < 60) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
    const minutes = Math.floor(seconds / 60);
    return minutes < 60 ? `${minutes} min ${Math.floor(seconds % 60)} s` : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
  },
  time: (text) => (text ? new Date(text).toLocaleString(undefined, { dateStyle: "medium", timeStyle: "medium" }) : "–"),
  moment: (text) => (text ? new Date(text).toLocaleString(undefined, { month: "short", day: "numeric", hour: "numeric", minute: "2-digit" }) : "–"),
  bytes: (size) => (size < 1024 ? `${size} B` : `${(size / 1024).toFixed(0)} kB`),
};

/* A writer of numbers that end at the second digit of `width`; all share the power of ten of `largest`. */
function roundedTo(width, largest) {
  const exponent = plainSize(largest) ? 0 : magnitude(largest);
  const unit = 10 ** (magnitude(width) - 1);
  const decimals = Math.max(1 - magnitude(width) + exponent, 0);
  const digits = { minimumFractionDigits: decimals, maximumFractionDigits: decimals };
  return (value) => ((Math.round(value / unit) * unit) / 10 ** exponent).toLocaleString("en", digits) + (exponent ? `·${power(exponent)}` : "");
}

/* A value and its interval [low, high] (null: open on that side) as two texts, rounded to the interval's width: of
   one that is even to both sides its half. */
function showMeasured(value, interval) {
  if (!known(value)) return ["–", ""];
  const [low, high] = interval ?? [null, null];
  if (!known(low) && !known(high)) return [show.number(value), ""];
  if (!known(low)) return [show.number(value), `at most ${show.number(high, 2)}`];
  if (!known(high)) return [show.number(value), `at least ${show.number(low, 2)}`];
  const near = Math.min(high - value, value - low), largest = Math.max(Math.abs(value), Math.abs(low), Math.abs(high));
  if (near <= 1e-6 * largest) return [show.number(value), `${show.number(low)} to ${show.number(high)}`];
  const write = roundedTo(near, largest);
  if (Math.abs(high + low - 2 * value) < 0.2 * near) return [write(value), `± ${write((high - low) / 2)}`];
  const far = (end) => Math.abs(end - value) > 10 * near || Math.abs(end) < 0.1 * near; // so near's digits mean nothing there
  const [from, to] = [low, high].map((end) => (far(end) ? show.number(end, 2) : write(end)));
  return [write(value), `${from} to ${to}`];
}
