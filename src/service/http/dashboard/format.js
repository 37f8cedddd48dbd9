// Numbers, times and sizes as people read them.

const whole = new Intl.NumberFormat("en");
const PREFIXES = [
  [1e12, "T"],
  [1e9, "G"],
  [1e6, "M"],
  [1e3, "k"],
  [1, ""],
  [1e-3, "m"],
  [1e-6, "µ"],
  [1e-9, "n"],
];

/** 1,234,567 */
export const count = (n) => whole.format(n);

/** Three significant digits, or as many as asked for: 0.00123, 12.3, 1.23e9. */
export function number(x, significant = 3) {
  if (x === null || x === undefined || !Number.isFinite(x)) return "–";
  if (x === 0) return "0";
  const size = Math.abs(x);
  if (size >= 1e6 || size < 1e-3) {
    const [digits, power] = x.toExponential(significant - 1).split("e");
    return `${Number(digits)}e${Number(power)}`.replaceAll("-", "−");
  }
  const digits = Math.max(0, significant - 1 - Math.floor(Math.log10(size)));
  return String(Number(x.toFixed(digits))).replace("-", "−");
}

/** With a prefix of the unit: 1.2 ms, 34 kPa. */
export function quantity(x, unit, significant = 3) {
  if (x === null || x === undefined || !Number.isFinite(x)) return "–";
  if (x === 0 || unit === "1" || unit === "") return number(x, significant) + (unit && unit !== "1" ? ` ${unit}` : "");
  const [scale, sign] = prefix(x);
  return `${number(x / scale, significant)} ${sign}${unit}`;
}

/** The prefix of a unit that makes numbers up to `x` short, and what it stands for. */
export function prefix(x) {
  return PREFIXES.find(([scale]) => Math.abs(x) >= scale) ?? PREFIXES.at(-1);
}

/** 27 million, 1.3 billion */
export function many(x) {
  return new Intl.NumberFormat("en", {
    notation: "compact",
    compactDisplay: "long",
    maximumSignificantDigits: 3,
  }).format(x);
}

/** 350 ms, 12 s, 3 min 5 s, 2 h 10 min, 3 d 4 h */
export function duration(seconds) {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return "–";
  if (seconds < 1) return quantity(seconds, "s");
  if (seconds < 10) return `${number(Math.round(seconds * 10) / 10)} s`;
  const parts = [
    [86400, "d"],
    [3600, "h"],
    [60, "min"],
    [1, "s"],
  ];
  let rest = Math.round(seconds);
  const first = parts.findIndex(([size]) => rest >= size);
  const said = parts.slice(first, first + 2).map(([size, unit]) => {
    const n = Math.floor(rest / size);
    rest -= n * size;
    return n ? `${n} ${unit}` : "";
  });
  return said.filter(Boolean).join(" ");
}

export function bytes(n) {
  const units = ["B", "kB", "MB", "GB", "TB"];
  const at = n > 0 ? Math.min(Math.floor(Math.log10(n) / 3), units.length - 1) : 0;
  return `${number(n / 1000 ** at)} ${units[at]}`;
}

/** Date and time, to the second. */
export function when(iso) {
  if (!iso) return "–";
  const date = new Date(iso);
  const two = (n) => String(n).padStart(2, "0");
  const day = `${date.getFullYear()}-${two(date.getMonth() + 1)}-${two(date.getDate())}`;
  return `${day} ${two(date.getHours())}:${two(date.getMinutes())}:${two(date.getSeconds())}`;
}

/** How long ago. */
export function ago(iso) {
  const seconds = (Date.now() - new Date(iso)) / 1000;
  if (seconds < 45) return "just now";
  return `${duration(seconds).split(" ").slice(0, 2).join(" ")} ago`;
}

/** 1st, 2nd, 3rd */
export function ordinal(n) {
  const ends = ["th", "st", "nd", "rd"];
  return n + (ends[((n % 100) - 20) % 10] ?? ends[n % 100] ?? ends[0]);
}

export const percent = (fraction) => `${Math.floor(fraction * 100)} %`;

/** The device of a job, in a few words. */
export function device(backend) {
  if (!backend) return "–";
  return backend.kind === "cpu" ? "CPU" : backend.device;
}
