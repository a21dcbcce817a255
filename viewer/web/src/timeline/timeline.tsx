// The time line: above, the whole case as a bar to scrub on, with pictures; below, a window of it that can be zoomed and moved, with a lane for each stream,
// marks, alarms and the proof of time, and the trends of vital signs.
import { useComputed, useSignal, useSignalEffect } from '@preact/signals';
import { useEffect, useLayoutEffect, useRef } from 'preact/hooks';
import { cases } from '@/api/client';
import type { ComparedStep } from '@/api/types';
import { spanAt, type Span } from '@/base/spans';
import { formatTime, kMinute, kSecond } from '@/base/time';
import type { MatchingModel } from '@/compare/matching_model';
import { StepFlags } from '@/compare/step_flags';
import { t, word } from '@/i18n/i18n';
import { pieceAt } from '@/media/pieces';
import type { Playback } from '@/media/playback';
import type { Stroke } from '@/pointing/recorded';
import { Icon } from '@/shell/icon';
import { theme } from '@/shell/state';
import { colorsOf, prepared } from '@/timeline/colors';
import { drawLanes, drawRuns, lanesOf } from '@/timeline/draw_lanes';
import { following, panned, toPixel, toTime, zoomed } from '@/timeline/scale';
import { TrendNames, Trends } from '@/timeline/trends';
import type { CaseModel } from '@/views/case_model';
import type { VitalsStore } from '@/vitals/vitals_store';

export const kGutter = 112;
const kOverview = 34;
const kZoomStep = 1.6;

function useWidth() {
  const element = useRef<HTMLDivElement>(null);
  const width = useSignal(0);
  useLayoutEffect(() => {
    const one = element.current as HTMLDivElement;
    const measure = () => {
      width.value = one.clientWidth;
    };
    const observer = new ResizeObserver(measure);
    observer.observe(one);
    measure();
    return () => observer.disconnect();
  }, []);
  return { element, width };
}

interface Props {
  model: CaseModel;
  playback: Playback;
  store: VitalsStore | undefined;
  selection: Span | undefined;
  onSelect: (span: Span | undefined) => void;
  withPictures: boolean;
  /** Of the comparison that is shown. */
  steps: readonly ComparedStep[];
  /** Where somebody pointed. */
  strokes: readonly Stroke[];
  /** While its steps are matched by hand. */
  matching: MatchingModel | undefined;
}

export function Timeline({ model, playback, store, selection, onSelect, withPictures, steps, strokes, matching }: Props) {
  const { element, width } = useWidth();
  const window = useSignal<Span>(model.whole);
  const hover = useSignal<{ time_ns: number; x: number; top: boolean } | undefined>(undefined);
  const overview = useRef<HTMLCanvasElement>(null);
  const lanes = useRef<HTMLCanvasElement>(null);
  const heads = useRef<(HTMLElement | null)[]>([]);
  const dark = theme.value;
  const whole = model.whole;
  const plot = useComputed(() => Math.max(50, width.value));
  const wide = plot.value;
  const version = store?.version.value ?? 0;
  const alarms = store?.over(window.value, wide).alarms ?? [];
  const hasSteps = matching !== undefined || steps.some((one) => one.done !== null);
  const list = lanesOf(model, alarms.length > 0 || (store?.over(whole, 200).alarms.length ?? 0) > 0, hasSteps, strokes.length > 0);
  const planLane = list.find((lane) => lane.kind === 'plan');
  const height = (list.at(-1)?.top ?? 0) + (list.at(-1)?.height ?? 0);

  // The window turns over when the clock leaves it, unless a hand holds it.
  const held = useRef(false);
  useSignalEffect(() => {
    const at_ns = playback.position_ns.value;
    const shown = window.value;
    const place = (head: HTMLElement | null | undefined, span: Span) => {
      if (!head) return;
      const x = toPixel(at_ns, span, plot.value);
      head.style.transform = `translateX(${x}px)`;
      head.style.visibility = x < -1 || x > plot.value + 1 ? 'hidden' : 'visible';
    };
    place(heads.current[0], whole);
    place(heads.current[1], shown);
    if (!held.current && playback.playing.value) {
      const turned = following(shown, whole, at_ns);
      if (turned !== shown) window.value = turned;
    }
  });
  const shown = window.value;

  useEffect(() => {
    const canvas = overview.current as HTMLCanvasElement;
    const colors = colorsOf(canvas);
    const context = prepared(canvas, wide, kOverview);
    const each = (kOverview - 10) / model.lanes.length;
    model.lanes.forEach(({ name }, at) => drawRuns(context, model, name, whole, wide, 6 + at * each, Math.max(2, each - 2), colors));
    for (const mark of model.marks) {
      context.fillStyle = colors('mark');
      context.fillRect(Math.round(toPixel(mark.time_ns, whole, wide)), 0, 2, kOverview - 3);
    }
  }, [model, wide, dark]);

  useEffect(() => {
    const canvas = lanes.current as HTMLCanvasElement;
    drawLanes(prepared(canvas, wide, height), list, model, alarms, steps, strokes, shown, wide, height, colorsOf(canvas));
  }, [model, wide, height, shown, dark, version, steps, strokes]);

  const zoom = (factor: number, about_ns = playback.position_ns.peek()) => {
    const about = Math.max(window.value.start_ns, Math.min(window.value.end_ns, about_ns));
    window.value = zoomed(window.value, whole, factor, about);
  };

  const timeOf = (event: PointerEvent | WheelEvent, span: Span) => {
    const box = (event.currentTarget as HTMLElement).getBoundingClientRect();
    return toTime(Math.max(0, Math.min(wide, event.clientX - box.left)), span, wide);
  };
  const drag = useRef<{ from_ns: number; selects: boolean } | undefined>(undefined);
  const pointer = (span: Span, top: boolean) => ({
    onPointerDown: (event: PointerEvent) => {
      if (event.button !== 0) return;
      const time_ns = timeOf(event, span);
      const near = top ? undefined : markAt(time_ns, span);
      drag.current = { from_ns: time_ns, selects: event.shiftKey };
      held.current = true;
      (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
      if (!event.shiftKey) playback.scrub(near ?? time_ns);
    },
    onPointerMove: (event: PointerEvent) => {
      const time_ns = timeOf(event, span);
      hover.value = { time_ns, x: toPixel(time_ns, span, wide), top };
      if (!drag.current) return;
      if (drag.current.selects) {
        const [start_ns, end_ns] = [drag.current.from_ns, time_ns].sort((a, b) => a - b) as [number, number];
        if (end_ns > start_ns) onSelect({ start_ns, end_ns });
      } else if (Math.abs(toPixel(time_ns, span, wide) - toPixel(drag.current.from_ns, span, wide)) > 2) {
        playback.scrub(time_ns);
      }
    },
    onPointerUp: () => {
      drag.current = undefined;
      held.current = false;
      if (top) window.value = following(window.value, whole, playback.position_ns.peek());
    },
    onPointerCancel: () => {
      drag.current = undefined;
      held.current = false;
    },
    onPointerLeave: () => {
      hover.value = undefined;
    },
  });
  /** A mark, or the beginning of a step or of pointing, within a finger's breadth of where one pointed. */
  const markAt = (time_ns: number, span: Span) =>
    [...model.marks.map((mark) => mark.time_ns), ...steps.flatMap((step) => step.done?.start_ns ?? []), ...strokes.map((stroke) => stroke.start_ns)].find(
      (one) => Math.abs(toPixel(one, span, wide) - toPixel(time_ns, span, wide)) < 6,
    );

  const wheelArea = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const area = wheelArea.current as HTMLDivElement;
    const wheel = (event: WheelEvent) => {
      event.preventDefault();
      const length = window.value.end_ns - window.value.start_ns;
      const sideways = event.shiftKey ? event.deltaY : event.deltaX;
      if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
        window.value = panned(window.value, whole, (sideways / plot.value) * length);
      } else {
        const box = area.getBoundingClientRect();
        zoom(2 ** (event.deltaY / 300), toTime(event.clientX - box.left, window.value, plot.value));
      }
    };
    area.addEventListener('wheel', wheel, { passive: false });
    return () => area.removeEventListener('wheel', wheel);
  }, [whole]);

  const hovered = hover.value;
  const pictured = model.videos[0];
  const thumbnail =
    withPictures && hovered && pictured && spanAt(model.recorded.get(pictured.name) ?? [], hovered.time_ns)
      ? cases.thumbnailAddress(model.info.id, pictured.name, pieceAt(hovered.time_ns))
      : undefined;
  const at = (time_ns: number, span: Span) => `${toPixel(time_ns, span, wide)}px`;
  const band = (span: Span) =>
    selection && (
      <div
        class="selection-band"
        style={{ left: at(Math.max(span.start_ns, selection.start_ns), span), width: `${Math.max(1, toPixel(Math.min(span.end_ns, selection.end_ns), span, wide) - toPixel(Math.max(span.start_ns, selection.start_ns), span, wide))}px` }}
        hidden={selection.end_ns < span.start_ns || selection.start_ns > span.end_ns}
      />
    );

  return (
    <section class="timeline" aria-label={t('timeline.label')}>
      <div class="timeline-row">
        <div class="timeline-tools">
          <button type="button" class="button button-quiet button-square" aria-label={t('timeline.closer')} title={t('timeline.closer')} onClick={() => zoom(1 / kZoomStep)}>
            <Icon name="zoomIn" />
          </button>
          <button type="button" class="button button-quiet button-square" aria-label={t('timeline.wider')} title={t('timeline.wider')} onClick={() => zoom(kZoomStep)}>
            <Icon name="zoomOut" />
          </button>
          <button type="button" class="button button-quiet button-square" aria-label={t('timeline.all')} title={t('timeline.all')} onClick={() => (window.value = whole)}>
            <Icon name="fit" />
          </button>
        </div>
        <div
          class="overview"
          ref={element}
          role="slider"
          tabIndex={0}
          aria-label={t('timeline.position')}
          aria-valuemin={0}
          aria-valuemax={Math.round((whole.end_ns - whole.start_ns) / kSecond)}
          aria-valuenow={Math.round((playback.position_ns.value - whole.start_ns) / kSecond)}
          aria-valuetext={formatTime(playback.position_ns.value - whole.start_ns)}
          {...pointer(whole, true)}
        >
          <canvas ref={overview} style={{ width: `${wide}px`, height: `${kOverview}px` }} />
          {band(whole)}
          <div
            class="overview-window"
            hidden={shown.end_ns - shown.start_ns >= whole.end_ns - whole.start_ns}
            style={{ left: at(shown.start_ns, whole), width: `${Math.max(3, toPixel(shown.end_ns, whole, wide) - toPixel(shown.start_ns, whole, wide))}px` }}
          />
          <div class="playhead" ref={(one) => void (heads.current[0] = one)} />
        </div>
      </div>
      <div class="timeline-row">
        <div class="lane-names">
          {list.map((lane) => (
            <span key={`${lane.kind}${lane.stream ?? ''}`} style={{ top: `${lane.top}px`, height: `${lane.height}px` }}>
              {lane.kind === 'stream' ? word('stream', lane.stream as string) : lane.kind === 'ruler' ? '' : t(`lane.${lane.kind}`)}
            </span>
          ))}
          {store && <TrendNames store={store} whole={whole} top={height} />}
        </div>
        <div class="lanes" ref={wheelArea} {...pointer(shown, false)}>
          <canvas ref={lanes} style={{ width: `${wide}px`, height: `${height}px` }} />
          {store && <Trends store={store} window={shown} whole={whole} width={wide} />}
          {band(shown)}
          <div class="playhead" ref={(one) => void (heads.current[1] = one)} />
          {matching && planLane && (
            <StepFlags matching={matching} playback={playback} window={shown} whole={whole} width={wide} top={planLane.top} height={planLane.height} />
          )}
        </div>
      </div>
      {hovered && (
        <div class={hovered.top ? 'hover-card hover-top' : 'hover-card'} style={{ left: `${kGutter + Math.max(84, Math.min(wide - 84, hovered.x))}px` }} aria-hidden="true">
          {thumbnail && <img src={thumbnail} width="160" height="90" alt="" onError={(event) => event.currentTarget.remove()} key={thumbnail} />}
          <span class="mono">{formatTime(hovered.time_ns - whole.start_ns, shown.end_ns - shown.start_ns < 10 * kMinute ? 2 : 0)}</span>
        </div>
      )}
    </section>
  );
}
