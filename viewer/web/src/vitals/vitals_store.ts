// The vital signs of one case, asked for in tiles and kept.
import { signal } from '@preact/signals';
import { ApiError, cases } from '@/api/client';
import type { Alarm, VitalNotice, VitalSeries, Vitals } from '@/api/types';
import type { Span } from '@/base/spans';
import { keyOfSeries } from '@/vitals/monitor';
import { kBinsOfTile, levelFor, type Tile, tileKey, tileSpan, tilesOver } from '@/vitals/tiles';

const kMostTiles = 400;
const kRetry_ms = 3000;
/** Until a server that is still reading a long stretch is asked again. */
const kStillReading_ms = 1000;

export class VitalsStore {
  /** Changes whenever something has come. */
  readonly version = signal(0);
  private readonly tiles = new Map<string, Vitals>();
  private readonly asked = new Set<string>();
  private readonly closing = new AbortController();

  constructor(
    private readonly caseId: string,
    readonly whole: Span,
    private readonly onProblem: (error: Error) => void,
  ) {}

  close(): void {
    this.closing.abort();
  }

  /** What is there of `window` at the zoom of `width` pixels; what lacks is asked for. Series in the server's order. */
  over(window: Span, width: number): { series: VitalSeries[]; alarms: Alarm[]; notices: VitalNotice[] } {
    const level = levelFor(window, width);
    const series = new Map<string, VitalSeries>();
    const alarms = new Map<string, Alarm>();
    const notices: VitalNotice[] = [];
    for (const tile of tilesOver(window, level)) {
      const span = tileSpan(tile);
      if (span.end_ns <= this.whole.start_ns || span.start_ns >= this.whole.end_ns) continue;
      const vitals = this.tiles.get(tileKey(tile));
      if (!vitals) {
        this.ask(tile);
        continue;
      }
      for (const one of vitals.series) {
        const whose = keyOfSeries(one);
        const known = series.get(whose);
        if (known) {
          known.bins = known.bins.concat(one.bins);
          known.questionable = known.questionable.concat(one.questionable);
        } else series.set(whose, { ...one });
      }
      for (const alarm of vitals.alarms) alarms.set(`${alarm.start_ns} ${alarm.text}`, alarm);
      notices.push(...vitals.notices);
    }
    return { series: [...series.values()], alarms: [...alarms.values()], notices };
  }

  /** Of the series with this keyOfSeries() what ends at or reaches to `time_ns`, looking back by `back_ns` at most. */
  before(key: string, time_ns: number, back_ns: number): Pick<VitalSeries, 'bins' | 'questionable'> {
    const window = { start_ns: time_ns - back_ns, end_ns: time_ns + 1 };
    return this.over(window, 200).series.find((one) => keyOfSeries(one) === key) ?? { bins: [], questionable: [] };
  }

  private ask(tile: Tile): void {
    const key = tileKey(tile);
    if (this.asked.has(key)) return;
    this.asked.add(key);
    void this.fetch(tile, key);
  }

  private async fetch(tile: Tile, key: string): Promise<void> {
    if (this.closing.signal.aborted) return;
    const span = tileSpan(tile);
    try {
      const vitals = await cases.vitals(this.caseId, Math.max(0, span.start_ns), span.end_ns, kBinsOfTile, this.closing.signal);
      this.tiles.set(key, vitals);
      for (const oldest of this.tiles.keys()) {
        if (this.tiles.size <= kMostTiles) break;
        this.tiles.delete(oldest);
        this.asked.delete(oldest);
      }
      for (const stretch of vitals.unreadable) this.onProblem(new Error(stretch.problem));
      this.version.value += 1;
    } catch (error) {
      if (this.closing.signal.aborted) return;
      if (error instanceof ApiError && error.status === 503) {
        setTimeout(() => void this.fetch(tile, key), kStillReading_ms);
        return;
      }
      setTimeout(() => this.asked.delete(key), kRetry_ms);
      if (error instanceof Error) this.onProblem(error);
    }
  }
}
