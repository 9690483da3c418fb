// Numbers and times as people read them.

const WHOLE = new Intl.NumberFormat("en", { maximumFractionDigits: 0 });
const RELATIVE = new Intl.RelativeTimeFormat("en", { numeric: "auto" });
const MISSING = "–";
const SPANS = [
  ["year", 31536000],
  ["month", 2592000],
  ["day", 86400],
  ["hour", 3600],
  ["minute", 60],
];

export const whole = (value) => (isNumber(value) ? WHOLE.format(value).replaceAll(",", "\u202f") : MISSING);
export const fixed = (value, digits) => (isNumber(value) ? signed(value.toFixed(digits)) : MISSING);
export const metres = (value, digits = 2) => (isNumber(value) ? `${fixed(value, digits)} m` : MISSING);
export const measured = (value, unit) => (unit ? `${fixed(value, 2)} ${unit}` : fixed(value, 2));
export const degrees = (radians) => (isNumber(radians) ? fixed((radians * 180) / Math.PI, 1) : MISSING);

/** "1 scan", "12 scans". */
export const count = (number, one, many = `${one}s`) => `${whole(number)} ${number === 1 ? one : many}`;

/** Milliseconds, in the unit that reads best. */
export function duration(milliseconds) {
  if (!isNumber(milliseconds)) return MISSING;
  if (milliseconds < 10) return `${milliseconds.toFixed(1)} ms`;
  return milliseconds < 1000 ? `${milliseconds.toFixed(0)} ms` : `${(milliseconds / 1000).toFixed(1)} s`;
}

/** "3 hours ago" of an ISO time or of seconds since 1970. */
export function ago(moment) {
  const time = new Date(typeof moment === "number" ? moment * 1000 : moment);
  if (Number.isNaN(time.getTime())) return "";
  const seconds = (time - Date.now()) / 1000;
  const [unit, span] = SPANS.find(([, length]) => Math.abs(seconds) >= length) ?? [null, 1];
  return unit ? RELATIVE.format(Math.round(seconds / span), unit) : "just now";
}

/** The ids of a list, the first few of them. */
export function some(ids, most = 4) {
  const shown = ids.slice(0, most).map(pair).join(", ");
  return ids.length > most ? `${shown} and ${whole(ids.length - most)} more` : shown;
}

/** An integration's id for reading: "0.12-0.13" becomes "0.12 – 0.13". */
export const pair = (id) => id.replace("-", " – ");

/** A pose as x, y, theta, whether it came as a list or with names. */
export function pose(value) {
  if (!value) return null;
  const [x, y, theta] = Array.isArray(value) ? value : [value.x, value.y, value.theta];
  return { x, y, theta };
}

/** A minus that is as wide as a plus, and none before a zero. */
function signed(number) {
  return number.replace(/^-(?=[0.]*$)/, "").replace("-", "−");
}

function isNumber(value) {
  return typeof value === "number" && Number.isFinite(value);
}
