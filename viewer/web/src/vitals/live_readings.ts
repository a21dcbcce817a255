// What a monitor shows now: numbers that are fresh, those that have fallen silent, and the last seconds of waves. Pure but for what it keeps.
import type { LiveSeries } from '@/api/types';
import { kSecond } from '@/base/time';
import { formatUnit, formatValue, type Group, groupsOf } from '@/vitals/monitor';

/** A number that nothing renewed for so long is not shown any more, and said to be silent. */
const kFresh_ns = 10 * kSecond;
/** Of those that are measured now and then. */
const kFreshSpot_ns = 600 * kSecond;
export const kWaveShown_ns = 6 * kSecond;
const kWaveKept_ns = 12 * kSecond;

export interface LiveReading {
  group: Group;
  text: string;
  mean: string;
  unit: string;
  /** For how long nothing has come, where that is too long. */
  silent_s: number | undefined;
}

/** Of several devices that measure the same the one that spoke last. */
function newest(series: readonly LiveSeries[], code: string): LiveSeries | undefined {
  return series
    .filter((one) => one.code === code && one.kind === 'numeric')
    .reduce<LiveSeries | undefined>((last, one) => (last === undefined || one.time_ns > last.time_ns ? one : last), undefined);
}

export function readingsOf(series: readonly LiveSeries[], now_ns: number): LiveReading[] {
  return groupsOf(series).map((group) => {
    const fresh_ns = group.spot ? kFreshSpot_ns : kFresh_ns;
    const all = group.codes.map((code) => newest(series, code));
    const known = all.filter((one) => one !== undefined);
    const last_ns = Math.max(...known.map((one) => one.time_ns));
    const age_ns = now_ns - last_ns;
    const shown = (one: LiveSeries | undefined) =>
      one && now_ns - one.time_ns <= fresh_ns && typeof one.value === 'number' ? formatValue(one.value) : undefined;
    const texts = all.map(shown);
    const mean = group.mean === undefined ? undefined : shown(newest(series, group.mean));
    return {
      group,
      text: texts.some((one) => one !== undefined) ? texts.map((one) => one ?? '–').join('/') : '– –',
      mean: mean === undefined ? '' : `(${mean})`,
      unit: formatUnit(known[0]?.unit ?? ''),
      silent_s: known.length > 0 && age_ns > fresh_ns ? Math.round(age_ns / kSecond) : undefined,
    };
  });
}

/** The waves of a room, as they come in blocks. */
export class LiveWaves {
  private readonly points = new Map<string, { time_ns: number; value: number | null }[]>();
  /** Until when everything is here. */
  last_ns = 0;

  add(series: readonly LiveSeries[]): void {
    for (const one of series) {
      if (one.kind !== 'wave') continue;
      const points = this.points.get(one.code) ?? [];
      this.points.set(one.code, points);
      for (const block of one.blocks ?? []) {
        const step_ns = kSecond / block.rate_hz;
        const known_ns = points.at(-1)?.time_ns ?? -Infinity;
        // Another case has begun.
        if (block.end_ns < known_ns - kWaveKept_ns) points.length = 0;
        block.values.forEach((value, i) => {
          const time_ns = block.end_ns - (block.values.length - i) * step_ns;
          if (time_ns > (points.at(-1)?.time_ns ?? -Infinity)) points.push({ time_ns, value });
        });
        this.last_ns = Math.max(this.last_ns, block.end_ns);
      }
      const from_ns = (points.at(-1)?.time_ns ?? 0) - kWaveKept_ns;
      const first = points.findIndex((point) => point.time_ns >= from_ns);
      if (first > 0) points.splice(0, first);
    }
  }

  clear(): void {
    this.points.clear();
    this.last_ns = 0;
  }

  /** From `from_ns` to `to_ns`; null where the device had no value. */
  of(code: string, from_ns: number, to_ns: number): readonly { time_ns: number; value: number | null }[] {
    return (this.points.get(code) ?? []).filter(({ time_ns }) => time_ns >= from_ns && time_ns <= to_ns);
  }
}
