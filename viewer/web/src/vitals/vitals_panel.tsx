// Numbers and waves at the case clock's position, as a monitor shows them. A value that nothing has renewed for a while says how old it is; where nothing
// was recorded there is none.
import { computed } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import uPlot from 'uplot';
import type { VitalSeries } from '@/api/types';
import { kSecond } from '@/base/time';
import { t, word } from '@/i18n/i18n';
import type { Playback } from '@/media/playback';
import { theme } from '@/shell/state';
import { type Bedside, bedsidesOf, formatUnit, formatValue, type Group, groupsOf, keyOfSeries, nameOfBedside } from '@/vitals/monitor';
import { columnsOf, isQuestionableAt, valueAt } from '@/vitals/tiles';
import type { VitalsStore } from '@/vitals/vitals_store';

const kNumbersEvery_ns = 0.2 * kSecond;
/** A number older than this is said to be old; one that is older still is not shown. */
const kNear_ns = 4 * kSecond;
const kFresh_ns = 10 * kSecond;
const kFreshSpot_ns = 600 * kSecond;
/** Monitors that speak once a minute are not silent in between. */
const kFreshIntervals = 2.5;
const kFreshMost_ns = 150 * kSecond;
const kWaveBehind_ns = 6 * kSecond;
const kWaveEvery_ms = 33;

function Wave({ of, color, store, playback }: { of: string; color: string; store: VitalsStore; playback: Playback }) {
  const place = useRef<HTMLDivElement>(null);
  const dark = theme.value;
  useEffect(() => {
    const element = place.current as HTMLDivElement;
    const style = getComputedStyle(element);
    const stroke = style.getPropertyValue(`--vital-${color}`);
    const plot = new uPlot(
      {
        width: Math.max(40, element.clientWidth),
        height: Math.max(24, element.clientHeight),
        legend: { show: false },
        cursor: { show: false },
        padding: [3, 4, 3, 0],
        axes: [{ show: false }, { show: false }],
        scales: { x: { time: false, auto: false }, y: { auto: true } },
        series: [{}, { stroke, width: 1.4, points: { show: false } }, { stroke, width: 1.4, points: { show: false } }],
        bands: [{ series: [2, 1], fill: stroke }],
      },
      [[], [], []],
      element,
    );
    const resize = new ResizeObserver(() => plot.setSize({ width: Math.max(40, element.clientWidth), height: Math.max(24, element.clientHeight) }));
    resize.observe(element);
    let frame = 0;
    let drawn_ms = 0;
    let drawn = '';
    const draw = (now_ms: number) => {
      frame = requestAnimationFrame(draw);
      if (now_ms - drawn_ms < kWaveEvery_ms) return;
      const at_ns = playback.position_ns.peek();
      const state = `${at_ns} ${store.version.peek()} ${plot.width}`;
      if (state === drawn) return;
      drawn = state;
      drawn_ms = now_ms;
      const from_ns = at_ns - kWaveBehind_ns;
      // Asked for a little ahead, so that the wave does not break off where a tile ends.
      const bins = store.over({ start_ns: from_ns, end_ns: at_ns + 4 * kSecond }, 1000).series.find((one) => keyOfSeries(one) === of)?.bins ?? [];
      const seen = bins.filter(([start, end]) => end > from_ns && start <= at_ns);
      const columns = columnsOf(seen, 0.25 * kSecond);
      plot.batch(() => {
        plot.setData([columns.x, columns.low, columns.high], true);
        plot.setScale('x', { min: from_ns / 1e9, max: at_ns / 1e9 });
      });
    };
    frame = requestAnimationFrame(draw);
    return () => {
      cancelAnimationFrame(frame);
      resize.disconnect();
      plot.destroy();
    };
  }, [of, color, store, playback, dark]);
  return <div class="wave" ref={place} aria-hidden="true" />;
}

interface Shown {
  text: string;
  mean: string;
  unit: string;
  age_s: number | undefined;
  /** It may be of an earlier patient, or a test. */
  isQuestionable: boolean;
}

/** All of one bedside: no reading is put together of two patients' values. */
function read(group: Group, bedside: Bedside<VitalSeries>, store: VitalsStore, at_ns: number): Shown {
  const main = bedside.series.find((one) => one.code === group.codes[0]);
  const usual_ns = kFreshIntervals * (main?.every_ns ?? 0);
  const fresh_ns = group.spot ? kFreshSpot_ns : Math.max(kFresh_ns, Math.min(kFreshMost_ns, usual_ns));
  const last = (code: string) => {
    const key = keyOfSeries({ code, stream: bedside.stream, source: bedside.source });
    const found = (back_ns: number) => {
      const { bins, questionable } = store.before(key, at_ns, back_ns);
      const value = valueAt(bins, at_ns);
      return value && { ...value, isQuestionable: isQuestionableAt(questionable, value.time_ns) };
    };
    const near = found(kNear_ns);
    if (near) return near;
    const far = found(fresh_ns);
    return far && at_ns - far.time_ns <= fresh_ns ? far : undefined;
  };
  const values = group.codes.map(last);
  const mean = group.mean === undefined ? undefined : last(group.mean);
  const oldest = Math.min(...values.map((one) => one?.time_ns ?? at_ns));
  const age_ns = at_ns - oldest;
  return {
    text: values.some((one) => one !== undefined) ? values.map((one) => (one ? formatValue(one.value) : '–')).join('/') : '– –',
    mean: mean ? `(${formatValue(mean.value)})` : '',
    unit: formatUnit(main?.unit ?? ''),
    age_s: age_ns > 5 * kSecond ? Math.round(age_ns / kSecond) : undefined,
    isQuestionable: [...values, mean].some((one) => one?.isQuestionable),
  };
}

interface ReadingProps {
  group: Group;
  bedside: Bedside<VitalSeries>;
  store: VitalsStore;
  playback: Playback;
  at_ns: number;
}

function Reading({ group, bedside, store, playback, at_ns }: ReadingProps) {
  const reading = read(group, bedside, store, at_ns);
  const wave = bedside.series.find((one) => one.kind === 'wave' && one.code === group.wave);
  return (
    <div class={`vital vital-${group.color}${wave ? ' vital-with-wave' : ''}${reading.isQuestionable ? ' vital-questionable' : ''}`}>
      {wave && <Wave of={keyOfSeries(wave)} color={group.color} store={store} playback={playback} />}
      <div class="vital-number">
        <span class="vital-label">
          {group.label} <small>{reading.unit}</small>
        </span>
        <span class={group.codes.length > 1 ? 'vital-value vital-pair' : 'vital-value'}>{reading.text}</span>
        {(reading.mean !== '' || reading.age_s !== undefined || reading.isQuestionable) && (
          <span class="vital-foot">
            <span>
              {reading.isQuestionable && <strong title={t('vitals.questionableWhat')}>{t('vitals.questionable')} </strong>}
              {reading.age_s !== undefined && t('vitals.age', { age: reading.age_s })}
            </span>
            <span>{reading.mean}</span>
          </span>
        )}
      </div>
    </div>
  );
}

export function VitalsPanel({ store, playback }: { store: VitalsStore; playback: Playback }) {
  const at = useMemo(() => computed(() => Math.floor(playback.position_ns.value / kNumbersEvery_ns) * kNumbersEvery_ns), [playback]);
  void store.version.value;
  const everything = store.over(store.whole, 200).series;
  if (everything.length === 0) return <p class="muted pad">{t('vitals.none')}</p>;
  const bedsides = bedsidesOf(everything).filter(({ series }) => groupsOf(series).length > 0);
  const at_ns = at.value;
  const active = store.over({ start_ns: at_ns - kNear_ns, end_ns: at_ns + 1 }, 200).alarms.filter((one) => one.start_ns <= at_ns && at_ns < one.end_ns);
  return (
    <div class="vitals">
      {active.map((alarm) => (
        <p key={`${alarm.start_ns}${alarm.text}`} class="vital-alarm">
          <span>{t('moment.alarm')}</span> {alarm.text}
          {alarm.questionable && <span title={t('vitals.questionableWhat')}> ({t('vitals.questionable')})</span>}
        </p>
      ))}
      {bedsides.map((bedside) => (
        <div key={bedside.key} class="vitals-of">
          {bedsides.length > 1 && <h3>{nameOfBedside(bedside, bedsides, (stream) => word('stream', stream))}</h3>}
          {groupsOf(bedside.series).map((group) => (
            <Reading key={group.key} group={group} bedside={bedside} store={store} playback={playback} at_ns={at_ns} />
          ))}
        </div>
      ))}
    </div>
  );
}
