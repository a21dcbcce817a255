// What a monitor shows now: numbers that are fresh, those that have fallen silent, and the last seconds of waves. Pure but for what it keeps.
import type { LiveSeries } from '@/api/types';
import { kSecond } from '@/base/time';
import { bedsidesOf, formatUnit, formatValue, type Group, groupsOf, keyOfSeries } from '@/vitals/monitor';

/** A number that nothing renewed for so long is not shown any more, and said to be silent. */
const kFresh_ns = 10 * kSecond;
/** Of those that are measured now and then. */
const kFreshSpot_ns = 600 * kSecond;
export const kWaveShown_ns = 6 * kSecond;
const kWaveKept_ns = 12 * kSecond;
/** So much later than others a bedside's blocks may come. */
const kWaveLate_ns = 3 * kSecond;

export interface LiveReading {
  group: Group;
  text: string;
  mean: string;
  unit: string;
  /** For how long nothing has come, where that is too long. */
  silent_s: number | undefined;
  /** It may be of an earlier patient, or a test. */
  isQuestionable: boolean;
}

/** What one source on one stream says: what a reading is made of is all of one patient. */
export interface LiveBedside {
  key: string;
  stream: string;
  source: string;
  readings: LiveReading[];
  /** Of each code that it shows as a wave, the key of LiveWaves. */
  waves: ReadonlyMap<string, string>;
}

export const liveBedsidesOf = (series: readonly LiveSeries[], now_ns: number): LiveBedside[] =>
  bedsidesOf(series)
    .map(({ key, stream, source, series: own }) => ({
      key,
      stream,
      source,
      readings: readingsOf(own, now_ns),
      waves: new Map(own.filter((one) => one.kind === 'wave').map((one) => [one.code, keyOfSeries(one)])),
    }))
    .filter(({ readings }) => readings.length > 0);

/** Of one bedside. */
function readingsOf(series: readonly LiveSeries[], now_ns: number): LiveReading[] {
  const number = (code: string) => series.find((one) => one.code === code && one.kind === 'numeric');
  return groupsOf(series).map((group) => {
    const fresh_ns = group.spot ? kFreshSpot_ns : kFresh_ns;
    const all = group.codes.map(number);
    const known = all.filter((one) => one !== undefined);
    const last_ns = Math.max(...known.map((one) => one.time_ns));
    const age_ns = now_ns - last_ns;
    const shown = (one: LiveSeries | undefined) =>
      one && now_ns - one.time_ns <= fresh_ns && typeof one.value === 'number' ? formatValue(one.value) : undefined;
    const texts = all.map(shown);
    const mean = group.mean === undefined ? undefined : shown(number(group.mean));
    return {
      group,
      text: texts.some((one) => one !== undefined) ? texts.map((one) => one ?? '–').join('/') : '– –',
      mean: mean === undefined ? '' : `(${mean})`,
      unit: formatUnit(known[0]?.unit ?? ''),
      isQuestionable: [...all, group.mean === undefined ? undefined : number(group.mean)].some((one) => one?.questionable && shown(one) !== undefined),
      silent_s: known.length > 0 && age_ns > fresh_ns ? Math.round(age_ns / kSecond) : undefined,
    };
  });
}

/** The waves of a room, as they come in blocks: each of one code, stream and source. */
export class LiveWaves {
  private readonly points = new Map<string, { time_ns: number; value: number | null }[]>();
  /** Until when everything is here. */
  last_ns = 0;

  add(series: readonly LiveSeries[]): void {
    for (const one of series) {
      if (one.kind !== 'wave') continue;
      const key = keyOfSeries(one);
      const points = this.points.get(key) ?? [];
      this.points.set(key, points);
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

  /** After when blocks are asked for: what another bedside sends later than those that are here must not be passed over. What comes twice is known. */
  get after_ns(): number {
    return Math.max(0, this.last_ns - kWaveLate_ns);
  }

  /** Of keyOfSeries(), from `from_ns` to `to_ns`; null where the device had no value. */
  of(key: string, from_ns: number, to_ns: number): readonly { time_ns: number; value: number | null }[] {
    return (this.points.get(key) ?? []).filter(({ time_ns }) => time_ns >= from_ns && time_ns <= to_ns);
  }
}
