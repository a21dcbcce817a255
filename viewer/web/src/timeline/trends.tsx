// Trends of vital signs in the time line's window: a line through what each was last, a band from its lowest to its highest, nothing where nothing came.
import { useEffect, useRef } from 'preact/hooks';
import uPlot from 'uplot';
import type { VitalSeries } from '@/api/types';
import type { Span } from '@/base/spans';
import { t, word } from '@/i18n/i18n';
import { theme } from '@/shell/state';
import { colorsOf } from '@/timeline/colors';
import { bedsidesOf, keyOfSeries, nameOfBedside, trendsOf } from '@/vitals/monitor';
import { columnsOf, gapOf, levelFor } from '@/vitals/tiles';
import type { VitalsStore } from '@/vitals/vitals_store';

const kHeight = 104;

const trendsIn = (store: VitalsStore, whole: Span) => {
  const bedsides = bedsidesOf(store.over(whole, 200).series);
  const { bedside, trends } = trendsOf(bedsides);
  return { trends, whose: bedside ? nameOfBedside(bedside, bedsides, (stream) => word('stream', stream)) : '' };
};

/** Behind the lines: where some of them may be of an earlier patient. */
function shade(drawing: uPlot, stretches: VitalSeries['questionable'], color: string): void {
  const { left, top, width, height } = drawing.bbox;
  drawing.ctx.save();
  drawing.ctx.fillStyle = color;
  drawing.ctx.globalAlpha = 0.25;
  for (const [start, end] of stretches) {
    const from = Math.max(left, drawing.valToPos(start / 1e9, 'x', true));
    const to = Math.min(left + width, drawing.valToPos(end / 1e9, 'x', true));
    if (to > from) drawing.ctx.fillRect(from, top, Math.max(2, to - from), height);
  }
  drawing.ctx.restore();
}

/** What the lines are, in their colours, beside them. */
export function TrendNames({ store, whole, top }: { store: VitalsStore; whole: Span; top: number }) {
  void store.version.value;
  const { trends, whose } = trendsIn(store, whole);
  return (
    <div class="trend-names" style={{ top: `${top}px`, height: `${kHeight}px` }} aria-hidden="true">
      {whose !== '' && <span class="trend-whose">{whose}</span>}
      {trends
        .filter(({ label }) => label !== '')
        .map(({ label, color }) => (
          <span key={label} class={`vital-${color}`}>
            {label}
          </span>
        ))}
    </div>
  );
}

export function Trends({ store, window, whole, width }: { store: VitalsStore; window: Span; whole: Span; width: number }) {
  const place = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  /** Of all that is drawn: where it is questionable. */
  const questionable = useRef<VitalSeries['questionable']>([]);
  const dark = theme.value;
  const version = store.version.value;
  const { trends: shown, whose } = trendsIn(store, whole);
  const key = shown.map((one) => one.key).join();

  useEffect(() => {
    if (shown.length === 0) return;
    const element = place.current as HTMLDivElement;
    const colors = colorsOf(element);
    const line = (color: string): uPlot.Series => ({ stroke: colors(`vital-${color}`), width: 1.5, points: { show: false } });
    plot.current = new uPlot(
      {
        width,
        height: kHeight,
        legend: { show: false },
        cursor: { show: false },
        padding: [6, 0, 4, 0],
        scales: {
          x: { time: false, auto: false },
          y: { range: (_, low, high) => [Math.max(0, Math.floor(low / 20) * 20 - 5), Math.ceil(high / 20) * 20 + 5] },
        },
        axes: [
          { show: false },
          {
            side: 1,
            size: 0,
            gap: -26,
            stroke: colors('muted'),
            font: '10px system-ui',
            grid: { stroke: colors('line'), width: 1 },
            ticks: { show: false },
            space: 28,
          },
        ],
        // The lowest, highest and last of each: three lines, of which the first two only bound a band.
        series: [{}, ...shown.flatMap(({ color }) => [{ points: { show: false } }, { points: { show: false } }, line(color)])],
        hooks: { drawClear: [(drawing) => shade(drawing, questionable.current, colors('muted'))] },
        bands: shown.map(({ color }, at) => ({ series: [3 * at + 2, 3 * at + 1] as [number, number], fill: `${colors(`vital-${color}`)}33` })),
      },
      [[]],
      element,
    );
    return () => {
      plot.current?.destroy();
      plot.current = null;
    };
  }, [key, dark, store]);

  useEffect(() => {
    const drawing = plot.current;
    if (!drawing) return;
    if (drawing.width !== width) drawing.setSize({ width, height: kHeight });
    const { series } = store.over(window, width);
    const level = levelFor(window, width);
    questionable.current = series.filter((each) => shown.some((trend) => trend.key === keyOfSeries(each))).flatMap((each) => each.questionable);
    const tables = shown.map((trend) => {
      const one = series.find((each) => keyOfSeries(each) === trend.key);
      const columns = columnsOf(one?.bins ?? [], gapOf(one?.every_ns ?? 0, level));
      return [columns.x, columns.low, columns.high, columns.last] as uPlot.AlignedData;
    });
    // Rows that one series has and another has not are no gaps of it; only its own empty ones are.
    const joined = uPlot.join(
      tables,
      tables.map((table) => table.map(() => 2)),
    );
    drawing.batch(() => {
      drawing.setData(joined, true);
      drawing.setScale('x', { min: window.start_ns / 1e9, max: window.end_ns / 1e9 });
    });
  }, [key, dark, window, width, version]);

  if (shown.length === 0) return null;
  return (
    <div
      class="trends"
      ref={place}
      role="img"
      aria-label={`${t('timeline.trends')}${whose === '' ? '' : ` · ${whose}`}: ${shown
        .map(({ label }) => label)
        .filter((label) => label !== '')
        .join(', ')}`}
    />
  );
}
