import { describe, expect, it } from 'vitest';
import type { VitalBin, VitalSeries } from '@/api/types';
import { formatUnit, formatValue, groupsOf } from '@/vitals/monitor';
import { columnsOf, gapOf, isQuestionableAt, kBinsOfTile, levelFor, tileLength_ns, tileSpan, tilesOver, valueAt } from '@/vitals/tiles';

describe('Tiles of vital signs', () => {
  it('have bins no wider than a pixel, and not finer than twice that', () => {
    for (let length = 2e9; length < 36_000e9; length *= 1.9) {
      const window = { start_ns: 0, end_ns: length };
      const bin = tileLength_ns(levelFor(window, 1000)) / kBinsOfTile;
      expect(bin).toBeLessThanOrEqual(length / 1000);
      if (levelFor(window, 1000) > 0) expect(bin * 2).toBeGreaterThan(length / 1000);
    }
  });
  it('cover their window without a hole', () => {
    const window = { start_ns: 7e9, end_ns: 33e9 };
    const tiles = tilesOver(window, 3);
    expect(tiles.map((one) => one.index)).toEqual([0, 1, 2, 3, 4]);
    expect(tileSpan(tiles[0]!).start_ns).toBeLessThanOrEqual(window.start_ns);
    expect(tileSpan(tiles.at(-1)!).end_ns).toBeGreaterThanOrEqual(window.end_ns);
  });
});

describe('The number beside the picture', () => {
  const bins: VitalBin[] = [
    [0, 1e9, 60, 62, 61],
    [1e9, 2e9, 70, 72, 71],
    [9e9, 10e9, 80, 82, 81],
  ];
  it('is the last that was measured, and says when', () => {
    expect(valueAt(bins, 1.5e9)).toEqual({ value: 71, time_ns: 1.5e9 });
    expect(valueAt(bins, 8e9)).toEqual({ value: 71, time_ns: 2e9 });
    expect(valueAt(bins, -1)).toBeUndefined();
  });
  it('says where it may be of an earlier patient', () => {
    const stretches: VitalSeries['questionable'] = [[1e9, 2e9]];
    expect([0.5e9, 1e9, 2e9, 2.5e9].map((at) => isQuestionableAt(stretches, at))).toEqual([false, true, true, false]);
  });
  it('is printed as monitors print it', () => {
    expect([72, 97.5, 36.6, 120.02, 5, 0.4].map(formatValue)).toEqual(['72', '97.5', '36.6', '120', '5', '0.4']);
    expect(['mm[Hg]', '%', '1', 'Cel', 'kPa'].map(formatUnit)).toEqual(['mmHg', '%', '', '°C', 'kPa']);
  });
});

describe('Drawing', () => {
  it('takes for a gap what is long for the series, and never a single bin', () => {
    expect(gapOf(1e9, 0)).toBe(3.5e9);
    expect(gapOf(60e9, 3)).toBe(210e9);
    expect(gapOf(1e9, 12)).toBe(28e9); // bins of 8 s
  });
  it('leaves a gap a gap', () => {
    const columns = columnsOf(
      [
        [0, 1e9, 1, 2, 2],
        [1e9, 2e9, 3, 4, 3],
        [20e9, 21e9, 5, 6, 5],
      ],
      5e9,
    );
    expect(columns.x).toEqual([0.5, 1.5, 11, 20.5]);
    expect(columns.low).toEqual([1, 3, null, 5]);
    expect(columns.high).toEqual([2, 4, null, 6]);
    expect(columns.last).toEqual([2, 3, null, 5]);
  });
});

describe('The monitor', () => {
  const series = (code: string, kind: 'numeric' | 'wave' = 'numeric'): VitalSeries => ({
    code,
    label: code,
    unit: '',
    kind,
    stream: 'vitals',
    source: '',
    every_ns: 1e9,
    bins: [],
    questionable: [],
  });
  it('shows what is there in its order, and what it does not know behind', () => {
    const groups = groupsOf([series('KIROKU_X'), series('MDC_PRESS_BLD_ART_ABP_DIA'), series('MDC_ECG_HEART_RATE'), series('MDC_ECG_ELEC_POTL_II', 'wave')]);
    expect(groups.map((one) => one.label)).toEqual(['HR', 'ABP', 'KIROKU_X']);
  });
});
