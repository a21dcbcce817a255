// The lanes of the time line: a window of the case that can be zoomed and moved, with a lane for each stream, marks, alarms and the proof of time, and the
// trends of vital signs.
import { useSignalEffect } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import type { ComparedStep, Stroke } from '@/api/types';
import type { Span } from '@/base/spans';
import type { MatchingModel } from '@/compare/matching_model';
import type { OrganEpisode } from '@/compare/organ_place';
import { StepFlags } from '@/compare/step_flags';
import { t, word } from '@/i18n/i18n';
import type { Playback } from '@/media/playback';
import { theme } from '@/shell/state';
import { colorsOf, prepared } from '@/timeline/colors';
import { drawLanes, lanesOf } from '@/timeline/draw_lanes';
import type { Deed } from '@/timeline/gesture';
import { HoverCard, Playhead, SelectionBand, usePointers } from '@/timeline/plot_parts';
import { toPixel, toTime } from '@/timeline/scale';
import type { TimelineWindow } from '@/timeline/timeline_window';
import { TrendNames, Trends } from '@/timeline/trends';
import { useWidth } from '@/timeline/use_width';
import type { CaseModel } from '@/views/case_model';
import type { VitalsStore } from '@/vitals/vitals_store';

/** Within so many pixels of a mark, the mark is meant. */
const kNear = 6;
const kNearForFingers = 16;

interface Props {
  model: CaseModel;
  playback: Playback;
  window: TimelineWindow;
  store: VitalsStore | undefined;
  selection: Span | undefined;
  onSelect: (span: Span) => void;
  withPictures: boolean;
  /** Of the comparison that is shown. */
  steps: readonly ComparedStep[];
  /** Where its organ was found in the pictures, and where not. */
  organ: readonly OrganEpisode[];
  /** Where somebody pointed. */
  strokes: readonly Stroke[];
  /** While its steps are matched by hand. */
  matching: MatchingModel | undefined;
}

export function Timeline({ model, playback, window, store, selection, onSelect, withPictures, steps, organ, strokes, matching }: Props) {
  const { element, width } = useWidth();
  const canvas = useRef<HTMLCanvasElement>(null);
  const dark = theme.value;
  const whole = model.whole;
  const wide = width.value;
  const shown = window.shown.value;
  const version = store?.version.value ?? 0;
  const alarms = store?.over(shown, wide).alarms ?? [];
  const hasSteps = matching !== undefined || steps.some((one) => one.done !== null);
  const list = lanesOf(model, alarms.length > 0 || (store?.over(whole, 200).alarms.length ?? 0) > 0, hasSteps, strokes.length > 0, organ.length > 0);
  const planLane = list.find((lane) => lane.kind === 'plan');
  const height = (list.at(-1)?.top ?? 0) + (list.at(-1)?.height ?? 0);

  // The window turns over when the clock leaves it, unless a hand holds it.
  useSignalEffect(() => {
    const at_ns = playback.position_ns.value;
    if (!window.isHeld && playback.playing.value) window.follow(at_ns);
  });

  useEffect(() => {
    const one = canvas.current as HTMLCanvasElement;
    drawLanes(prepared(one, wide, height), list, model, alarms, steps, organ, strokes, shown, wide, height, colorsOf(one));
  }, [model, wide, height, shown, dark, version, steps, organ, strokes]);

  /** A mark, or the beginning of a step or of pointing, near `x`. */
  const momentNear = (x: number): number | undefined => {
    const near = matchMedia('(pointer: coarse)').matches ? kNearForFingers : kNear;
    return [
      ...model.marks.map((mark) => mark.time_ns),
      ...steps.flatMap((step) => step.done?.start_ns ?? []),
      ...strokes.map((stroke) => stroke.start_ns),
    ].find((one) => Math.abs(toPixel(one, window.shown.peek(), width.peek()) - x) < near);
  };
  const timeAt = (x: number) => toTime(x, window.shown.peek(), width.peek());
  const act = (deed: Deed) => {
    switch (deed.do) {
      case 'point':
        return playback.scrub(momentNear(deed.x) ?? timeAt(deed.x));
      case 'scrub':
        return playback.scrub(timeAt(deed.x));
      case 'select':
        return onSelect({ start_ns: timeAt(deed.from), end_ns: timeAt(deed.to) });
      case 'pinch':
        return window.pinch(deed.from, deed.to, width.peek());
    }
  };
  const { listeners, hovered } = usePointers({
    span: () => window.shown.peek(),
    width: () => width.peek(),
    atOnce: false,
    act,
    onHeld: (held) => (window.isHeld = held),
  });

  useEffect(() => {
    const area = element.current as HTMLDivElement;
    const wheel = (event: WheelEvent) => {
      event.preventDefault();
      const sideways = event.shiftKey ? event.deltaY : event.deltaX;
      if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
        window.pan(sideways / width.peek());
      } else {
        window.zoom(2 ** (event.deltaY / 300), timeAt(event.clientX - area.getBoundingClientRect().left));
      }
    };
    area.addEventListener('wheel', wheel, { passive: false });
    return () => area.removeEventListener('wheel', wheel);
  }, [window]);

  return (
    <section class="timeline" aria-label={t('timeline.label')}>
      <div class="timeline-row">
        <div class="lane-names">
          {list.map((lane) => (
            <span key={`${lane.kind}${lane.stream ?? ''}`} style={{ top: `${lane.top}px`, height: `${lane.height}px` }}>
              {lane.kind === 'stream' ? word('stream', lane.stream as string) : lane.kind === 'ruler' ? '' : t(`lane.${lane.kind}`)}
            </span>
          ))}
          {store && <TrendNames store={store} whole={whole} top={height} />}
        </div>
        <div class="lanes" ref={element} {...listeners}>
          <canvas ref={canvas} style={{ width: `${wide}px`, height: `${height}px` }} />
          {store && <Trends store={store} window={shown} whole={whole} width={wide} />}
          <SelectionBand selection={selection} span={shown} width={wide} />
          <Playhead playback={playback} span={window.shown} width={width} />
          {matching && planLane && (
            <StepFlags matching={matching} playback={playback} window={shown} whole={whole} width={wide} top={planLane.top} height={planLane.height} />
          )}
        </div>
        {hovered.value && (
          <HoverCard
            model={model}
            hovered={hovered.value}
            length_ns={shown.end_ns - shown.start_ns}
            left={element.current?.offsetLeft ?? 0}
            width={wide}
            withPictures={withPictures}
          />
        )}
      </div>
    </section>
  );
}
