// Times of a case: whole nanoseconds of the case clock, shown as hours, minutes and seconds from where the case begins. A number holds them exactly up
// to 104 days.

export const kSecond = 1e9;
export const kMinute = 60 * kSecond;
export const kHour = 60 * kMinute;

const pad = (value: number, digits: number) => String(value).padStart(digits, '0');

/** "01:02:03", or with `decimals` 1 to 3 "01:02:03.450". Never rounds up into the next second. */
export function formatTime(ns: number, decimals = 0): string {
  const sign = ns < 0 ? '-' : '';
  const milliseconds = Math.floor(Math.abs(ns) / 1e6 + 1e-9);
  const seconds = Math.floor(milliseconds / 1000);
  const text = `${pad(Math.floor(seconds / 3600), 2)}:${pad(Math.floor(seconds / 60) % 60, 2)}:${pad(seconds % 60, 2)}`;
  if (decimals === 0) return sign + text;
  return `${sign}${text}.${pad(milliseconds % 1000, 3).slice(0, decimals)}`;
}

/** A length in the largest units that say something: "3 h 20 min", "20 s". */
export function formatDuration(ns: number): string {
  const seconds = Math.round(ns / kSecond);
  if (seconds < 60) return `${seconds} s`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 60) return seconds % 60 === 0 ? `${minutes} min` : `${minutes} min ${seconds % 60} s`;
  return minutes % 60 === 0 ? `${Math.floor(minutes / 60)} h` : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

/** What a person types: "90" (seconds), "1:30", "01:30:00", "12.5", "1h2m3s", "+5", "-1:00" (from `now_ns`). Nothing if it is no time. */
export function parseTime(text: string, now_ns = 0): number | undefined {
  const trimmed = text.trim().replaceAll('：', ':');
  const relative = /^[+-]/.exec(trimmed);
  const body = relative ? trimmed.slice(1) : trimmed;
  const seconds = parseColons(body) ?? parseUnits(body);
  if (seconds === undefined) return undefined;
  const ns = Math.round(seconds * 1000) * 1e6;
  if (!relative) return ns;
  return relative[0] === '-' ? now_ns - ns : now_ns + ns;
}

function parseColons(text: string): number | undefined {
  const match = /^(?:(?:(\d+):)?(\d{1,2}):)?(\d+(?:\.\d+)?)$/.exec(text);
  if (!match) return undefined;
  const [, hours, minutes, seconds] = match;
  if (minutes !== undefined && Number(seconds) >= 60) return undefined;
  if (hours !== undefined && Number(minutes) >= 60) return undefined;
  return Number(hours ?? 0) * 3600 + Number(minutes ?? 0) * 60 + Number(seconds);
}

function parseUnits(text: string): number | undefined {
  const match = /^(?:(\d+)\s*h)?\s*(?:(\d+)\s*m(?:in)?)?\s*(?:(\d+(?:\.\d+)?)\s*s)?$/.exec(text);
  if (!match || text === '') return undefined;
  const [, hours, minutes, seconds] = match;
  return Number(hours ?? 0) * 3600 + Number(minutes ?? 0) * 60 + Number(seconds ?? 0);
}

/** "8.2 GB": decimal units, as disks are sold. */
export function formatBytes(bytes: number): string {
  const units = ['B', 'kB', 'MB', 'GB', 'TB'];
  let value = bytes;
  let unit = 0;
  while (value >= 999.5 && unit < units.length - 1) {
    value /= 1000;
    ++unit;
  }
  const digits = unit === 0 || value >= 99.95 ? 0 : 1;
  return `${value.toFixed(digits)} ${units[unit]}`;
}
