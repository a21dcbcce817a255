// Vital signs come in tiles: a tile of level L covers 2^L seconds of the case clock in a fixed number of bins, so that what was once asked for serves
// again at the same zoom. Pure functions.
import type { Span } from '@/base/spans';
import type { VitalBin, VitalSeries } from '@/api/types';

export const kBinsOfTile = 512;

export interface Tile {
  level: number;
  index: number;
}

export const tileLength_ns = (level: number): number => 2 ** level * 1e9;

export const tileSpan = ({ level, index }: Tile): Span => ({
  start_ns: index * tileLength_ns(level),
  end_ns: (index + 1) * tileLength_ns(level),
});

export const tileKey = ({ level, index }: Tile): string => `${level}/${index}`;

/** The level whose bins are no wider than a pixel of `window` drawn `width` pixels wide. */
export function levelFor(window: Span, width: number): number {
  const pixel_ns = (window.end_ns - window.start_ns) / Math.max(1, width);
  return Math.max(0, Math.min(20, Math.floor(Math.log2((pixel_ns * kBinsOfTile) / 1e9))));
}

export function tilesOver(window: Span, level: number): Tile[] {
  const length = tileLength_ns(level);
  const tiles: Tile[] = [];
  for (let index = Math.floor(window.start_ns / length); index * length < window.end_ns; ++index) tiles.push({ level, index });
  return tiles;
}

/** What a series was at `time_ns`: of the newest bin that begins at or before it, its last value and when that bin ends, at most `time_ns`. */
export function valueAt(bins: readonly VitalBin[], time_ns: number): { value: number; time_ns: number } | undefined {
  for (let i = bins.length - 1; i >= 0; --i) {
    const [start, end, , , last] = bins[i] as VitalBin;
    if (start <= time_ns) return { value: last, time_ns: Math.min(end, time_ns) };
  }
  return undefined;
}

/** Whether `time_ns` lies within one of the series' questionable stretches: its end belongs to it, as valueAt() gives the end of a bin. */
export const isQuestionableAt = (stretches: VitalSeries['questionable'], time_ns: number): boolean =>
  stretches.some(([start, end]) => start <= time_ns && time_ns <= end);

/** What is so many times further apart than usual is a gap. */
const kGapFactor = 3.5;

/** From which distance on two neighbours of a series that speaks each `every_ns` have a gap between them, drawn with the bins of `level`. */
export const gapOf = (every_ns: number, level: number): number => kGapFactor * Math.max(every_ns, tileLength_ns(level) / kBinsOfTile);

export interface PlotColumns {
  x: number[]; // seconds of the case clock
  low: (number | null)[];
  high: (number | null)[];
  last: (number | null)[];
}

/** Columns to draw: a bin's middle with its lowest, highest and last value, and an empty place wherever nothing came for longer than `gap_ns`. */
export function columnsOf(bins: readonly VitalBin[], gap_ns: number): PlotColumns {
  const columns: PlotColumns = { x: [], low: [], high: [], last: [] };
  let before: number | undefined;
  for (const [start, end, low, high, last] of bins) {
    const middle = (start + end) / 2;
    if (before !== undefined && middle - before > gap_ns) {
      columns.x.push((before + middle) / 2e9);
      columns.low.push(null);
      columns.high.push(null);
      columns.last.push(null);
    }
    columns.x.push(middle / 1e9);
    columns.low.push(low);
    columns.high.push(high);
    columns.last.push(last);
    before = middle;
  }
  return columns;
}
