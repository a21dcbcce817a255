// The whole case as a bar to scrub on, with what was recorded, marks, and the frame of what the lanes show.
import { useEffect, useRef } from 'preact/hooks';
import { useComputed } from '@preact/signals';
import type { Span } from '@/base/spans';
import { formatTime, kSecond } from '@/base/time';
import { t } from '@/i18n/i18n';
import type { Playback } from '@/media/playback';
import { Icon } from '@/shell/icon';
import { theme } from '@/shell/state';
import { colorsOf, prepared } from '@/timeline/colors';
import { drawRuns } from '@/timeline/draw_lanes';
import type { Deed } from '@/timeline/gesture';
import { HoverCard, Playhead, SelectionBand, usePointers } from '@/timeline/plot_parts';
import { toPixel, toTime } from '@/timeline/scale';
import { kZoomStep, type TimelineWindow } from '@/timeline/timeline_window';
import { useWidth } from '@/timeline/use_width';
import type { CaseModel } from '@/views/case_model';

const kHeight = 34;

interface Props {
  model: CaseModel;
  playback: Playback;
  window: TimelineWindow;
  selection: Span | undefined;
  onSelect: (span: Span) => void;
  withPictures: boolean;
}

function ZoomTools({ window, playback }: { window: TimelineWindow; playback: Playback }) {
  const zoom = (factor: number) => window.zoom(factor, playback.position_ns.peek());
  return (
    <div class="timeline-tools">
      <button
        type="button"
        class="button button-quiet button-square"
        aria-label={t('timeline.closer')}
        title={t('timeline.closer')}
        onClick={() => zoom(1 / kZoomStep)}
      >
        <Icon name="zoomIn" />
      </button>
      <button
        type="button"
        class="button button-quiet button-square"
        aria-label={t('timeline.wider')}
        title={t('timeline.wider')}
        onClick={() => zoom(kZoomStep)}
      >
        <Icon name="zoomOut" />
      </button>
      <button type="button" class="button button-quiet button-square" aria-label={t('timeline.all')} title={t('timeline.all')} onClick={() => window.showAll()}>
        <Icon name="fit" />
      </button>
    </div>
  );
}

export function Overview({ model, playback, window, selection, onSelect, withPictures }: Props) {
  const { element, width } = useWidth();
  const canvas = useRef<HTMLCanvasElement>(null);
  const dark = theme.value;
  const whole = model.whole;
  const wide = width.value;
  const span = useComputed(() => whole);
  const shown = window.shown.value;

  useEffect(() => {
    const one = canvas.current as HTMLCanvasElement;
    const colors = colorsOf(one);
    const context = prepared(one, wide, kHeight);
    const each = (kHeight - 10) / model.lanes.length;
    model.lanes.forEach(({ name }, at) => drawRuns(context, model, name, whole, wide, 6 + at * each, Math.max(2, each - 2), colors));
    for (const mark of model.marks) {
      context.fillStyle = colors('mark');
      context.fillRect(Math.round(toPixel(mark.time_ns, whole, wide)), 0, 2, kHeight - 3);
    }
  }, [model, wide, dark]);

  const timeAt = (x: number) => toTime(x, whole, width.peek());
  const act = (deed: Deed) => {
    if (deed.do === 'select') onSelect({ start_ns: timeAt(deed.from), end_ns: timeAt(deed.to) });
    else if (deed.do !== 'pinch') playback.scrub(timeAt(deed.x));
  };
  const onHeld = (held: boolean) => {
    window.isHeld = held;
    if (!held) window.follow(playback.position_ns.peek());
  };
  const { listeners, hovered } = usePointers({ span: () => whole, width: () => width.peek(), atOnce: true, act, onHeld });
  const at = (time_ns: number) => toPixel(time_ns, whole, wide);
  return (
    <div class="timeline-row overview-row">
      <ZoomTools window={window} playback={playback} />
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
        {...listeners}
      >
        <canvas ref={canvas} style={{ width: `${wide}px`, height: `${kHeight}px` }} />
        <SelectionBand selection={selection} span={whole} width={wide} />
        <div
          class="overview-window"
          hidden={shown.end_ns - shown.start_ns >= whole.end_ns - whole.start_ns}
          style={{ left: `${at(shown.start_ns)}px`, width: `${Math.max(3, at(shown.end_ns) - at(shown.start_ns))}px` }}
        />
        <Playhead playback={playback} span={span} width={width} />
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
  );
}
