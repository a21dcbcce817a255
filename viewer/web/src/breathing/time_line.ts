// Moments of a breathing lung: playing them in real time, stepping from one to the next, and what is told of each. Pure.
import type { SeenTumour } from '@/breathing/breathing_api';
import type { Vector } from '@/breathing/motion';

/** The moments, ascending, and how long all of it lasts: of a breath that repeats longer than to its last moment. */
export interface TimeLine {
  times_s: readonly number[];
  duration_s: number;
}

export const beginOf = ({ times_s }: TimeLine): number => times_s[0] ?? 0;
const lengthOf = (line: TimeLine): number => Math.max(line.duration_s, (line.times_s.at(-1) ?? 0) - beginOf(line));

/** The moment that is seen at a time: the last one by then. */
export function momentAt({ times_s }: TimeLine, time_s: number): number {
  let at = 0;
  for (const [i, one] of times_s.entries()) if (one <= time_s + 1e-9) at = i;
  return at;
}

/** From `time_s` so much later; from the end it goes on at the beginning. */
export function later(line: TimeLine, time_s: number, by_s: number): number {
  const begin = beginOf(line);
  const length = lengthOf(line);
  if (!(length > 0)) return begin;
  const since = (time_s - begin + by_s) % length;
  return begin + (since < 0 ? since + length : since);
}

/** The moment so many before or after the one that is seen, round and round. */
export function stepped(line: TimeLine, time_s: number, by: number): number {
  const count = line.times_s.length;
  if (count === 0) return time_s;
  return line.times_s[(((momentAt(line, time_s) + by) % count) + count) % count] ?? time_s;
}

/** How far the tumour was seen from where the motion has it, by moment; null where it was not seen. */
export const distances = (seen: readonly (SeenTumour | null)[], path_mm: readonly Vector[]): (number | null)[] =>
  seen.map((one, i) => {
    const there = path_mm[i];
    return one && there ? Math.hypot(...one.mm.map((value, axis) => value - (there[axis] ?? 0))) : null;
  });
/** Of what is known; 0 where nothing is. */
export function meanOf(values: readonly (number | null)[]): number {
  const known = values.filter((one): one is number => one !== null);
  return known.length > 0 ? known.reduce((sum, one) => sum + one, 0) / known.length : 0;
}
