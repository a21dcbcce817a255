// The monitors of a room while it is recorded: numbers, waves and alarms. What has fallen silent says so.
import { useSignal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import { ApiError, appliance as api } from '@/api/client';
import type { LiveVitals } from '@/api/types';
import { kSecond } from '@/base/time';
import type { RemoteClock } from '@/clock/remote_clock';
import { t, word } from '@/i18n/i18n';
import { Icon } from '@/shell/icon';
import { theme } from '@/shell/state';
import { kWaveShown_ns, liveBedsidesOf, type LiveReading, LiveWaves } from '@/vitals/live_readings';
import { nameOfBedside } from '@/vitals/monitor';

const kEvery_ms = 500;
const kDraw_ms = 66;
/** Waves come in blocks of a second: what is drawn is so much older than now, and moves evenly. */
const kWaveBehind_ns = 2 * kSecond;
const kMargin = 3;

function Wave({ of, color, waves, clock }: { of: string; color: string; waves: LiveWaves; clock: RemoteClock }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const dark = theme.value;
  useEffect(() => {
    const element = canvas.current as HTMLCanvasElement;
    const context = element.getContext('2d') as CanvasRenderingContext2D;
    const stroke = getComputedStyle(element).getPropertyValue(`--vital-${color}`);
    const draw = () => {
      const ratio = devicePixelRatio;
      const { clientWidth: width, clientHeight: height } = element;
      element.width = Math.round(width * ratio);
      element.height = Math.round(height * ratio);
      context.scale(ratio, ratio);
      const now_ns = clock.at(performance.now());
      if (now_ns === undefined) return;
      const to_ns = now_ns - kWaveBehind_ns;
      const points = waves.of(of, to_ns - kWaveShown_ns, to_ns);
      const values = points.flatMap(({ value }) => (value === null ? [] : [value]));
      if (values.length === 0) return;
      const low = Math.min(...values);
      const span = Math.max(...values) - low || 1;
      context.strokeStyle = stroke;
      context.lineWidth = 1.4;
      context.beginPath();
      let draws = false;
      for (const { time_ns, value } of points) {
        if (value === null) {
          draws = false;
          continue;
        }
        const x = width * (1 - (to_ns - time_ns) / kWaveShown_ns);
        const y = height - kMargin - ((value - low) / span) * (height - 2 * kMargin);
        if (draws) context.lineTo(x, y);
        else context.moveTo(x, y);
        draws = true;
      }
      context.stroke();
    };
    const timer = setInterval(draw, kDraw_ms);
    return () => clearInterval(timer);
  }, [of, color, waves, clock, dark]);
  return <canvas class="wave live-wave" ref={canvas} aria-hidden="true" />;
}

interface ReadingProps {
  reading: LiveReading;
  /** The key of its wave. */
  wave: string | undefined;
  waves: LiveWaves;
  clock: RemoteClock;
}

function Reading({ reading: { group, text, mean, unit, silent_s, isQuestionable }, wave, waves, clock }: ReadingProps) {
  return (
    <div
      class={`vital vital-${group.color}${wave === undefined ? '' : ' vital-with-wave'}${silent_s === undefined ? '' : ' vital-silent'}${isQuestionable ? ' vital-questionable' : ''}`}
    >
      {wave !== undefined && <Wave of={wave} color={group.color} waves={waves} clock={clock} />}
      <div class="vital-number">
        <span class="vital-label">
          {group.label} <small>{unit}</small>
        </span>
        <span class={group.codes.length > 1 ? 'vital-value vital-pair' : 'vital-value'}>{text}</span>
        <span class="vital-foot">
          <span>
            {isQuestionable && <strong title={t('vitals.questionableWhat')}>{t('vitals.questionable')} </strong>}
            {silent_s !== undefined && (
              <>
                <Icon name="alarm" /> {t('vitals.silent', { seconds: silent_s })}
              </>
            )}
          </span>
          <span>{mean}</span>
        </span>
      </div>
    </div>
  );
}

export function LiveVitalsPanel({ room, clock }: { room: string; clock: RemoteClock }) {
  const shown = useSignal<LiveVitals | undefined>(undefined);
  const gone = useSignal(false);
  const waves = useMemo(() => new LiveWaves(), [room]);
  useEffect(() => {
    const closing = new AbortController();
    let timer: ReturnType<typeof setTimeout>;
    const ask = async () => {
      try {
        const said = await api.vitals(room, waves.after_ns, closing.signal);
        const before = shown.peek();
        // Another case, with a clock of its own: its waves are asked for anew.
        if (typeof before?.now_ns === 'number' && said.now_ns !== null && said.now_ns < before.now_ns) waves.clear();
        else waves.add(said.series);
        shown.value = said;
        gone.value = false;
      } catch (error) {
        if (closing.signal.aborted) return;
        // Where this program records no vital signs there is nothing to ask for.
        if (error instanceof ApiError && error.status === 404) return;
        gone.value = true;
      }
      timer = setTimeout(() => void ask(), kEvery_ms);
    };
    void ask();
    return () => {
      closing.abort();
      clearTimeout(timer);
    };
  }, [room, waves]);
  const said = shown.value;
  if (!said || said.now_ns === null) return null;
  const now_ns = Math.max(said.now_ns, clock.at(performance.now()) ?? 0);
  const bedsides = liveBedsidesOf(said.series, now_ns);
  const all = [...bedsides, ...said.alarms];
  // Also of one alone: the next may begin to speak, or this one be another bed's.
  const nameOf = (one: { stream: string; source: string }) => nameOfBedside(one, all, (stream) => word('stream', stream)) || one.source;
  return (
    <section class="vitals live-vitals" aria-label={t('vitals.liveOf', { room })}>
      {gone.value && (
        <p class="vital-alarm">
          <Icon name="alarm" /> {t('vitals.liveGone')}
        </p>
      )}
      {said.alarms.map((alarm) => (
        <p key={`${alarm.since_ns}${alarm.text}${alarm.stream}${alarm.source}`} class="vital-alarm" role="alert">
          <Icon name="alarm" /> <span>{t('moment.alarm')}</span> {alarm.text}
          {nameOf(alarm) !== '' && <span class="vital-whose"> {nameOf(alarm)}</span>}
        </p>
      ))}
      {said.series.length === 0 && <p class="muted pad live-vitals-none">{t('vitals.liveNone')}</p>}
      {bedsides.map((one) => (
        <div key={one.key} class="vitals-of">
          {nameOf(one) !== '' && <h3>{nameOf(one)}</h3>}
          {one.readings.map((reading) => (
            <Reading key={reading.group.key} reading={reading} wave={one.waves.get(reading.group.wave ?? '')} waves={waves} clock={clock} />
          ))}
        </div>
      ))}
    </section>
  );
}
