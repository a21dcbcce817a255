// Where things stand in a small chart. Pure functions.
export interface Scale {
  ticks: number[];
  least: number;
  most: number;
}

/** From 0 to a round number above `most`, in at most four steps of 1, 2 or 5. */
export function scaleTo(most: number): Scale {
  const safe = most > 0 && Number.isFinite(most) ? most : 1;
  const rough = safe / 4;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= rough * 0.999) ?? 10 * power;
  const count = Math.max(1, Math.ceil(safe / step - 1e-9));
  const ticks = Array.from({ length: count + 1 }, (_, i) => Number((i * step).toPrecision(12)));
  return { ticks, least: 0, most: ticks[count] ?? safe };
}

/** Whole numbers from 1 to `last`, eight at most. */
export function countTicks(last: number): number[] {
  const every = Math.max(1, Math.ceil(last / 8));
  return Array.from({ length: last }, (_, i) => i + 1).filter((one) => (one - 1) % every === 0);
}

export const place = (value: number, least: number, most: number, from: number, to: number): number =>
  from + ((to - from) * (value - least)) / (most - least || 1);
